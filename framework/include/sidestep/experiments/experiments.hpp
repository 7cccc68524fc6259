#pragma once

#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/reference.hpp>
#include <sidestep/runtime/session.hpp>

/// What the command does with experiments, whichever plugins they are. [main]

namespace sidestep {

/// The blocks that are not plugins', and those of the experiments, for reference pages.
[[nodiscard]] std::vector<SettingsBlock> settings_blocks(Host& host);

/// What every experiment's block says of the run itself, read before there is a host; mistakes
/// are left to check_configuration().
[[nodiscard]] RunSettings read_run_settings(const Configuration& configuration);

/// All mistakes in a configuration that can be known without running it: experiment and
/// its parameters, plugin blocks, planning settings, poses of plans.
[[nodiscard]] std::vector<Error> check_configuration(const Configuration& configuration,
                                                     Host& host);

/// The configuration with every default filled in and every value's origin: what
/// effective_config.yaml holds.
[[nodiscard]] Node effective_configuration(const Configuration& configuration, Host& host);

/// Runs a checked configuration and leaves in context.out: effective_config.yaml,
/// results.sqlite, summary.json, table.csv, report.html and its pictures. Files of an earlier run
/// are removed first, but for its results where context.resume goes on with them. Fails with
/// kConfig where a shard or going on is asked of an experiment that cannot, and where
/// it could not be done at all (exit codes 2 to 4); a task that fails is an outcome.
[[nodiscard]] Result<ExperimentOutcome> run_experiment(ExperimentContext& context);

}  // namespace sidestep
