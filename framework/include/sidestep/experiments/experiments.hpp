#pragma once

#include <filesystem>
#include <string>
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

/// Draws the pictures of a run and writes report.html, which holds them all, from what the run
/// left in its folder: summary.json, results.sqlite, effective_config.yaml. The pictures are
/// written beside it as PNG. Fails with kNotFound where the folder holds no run, kIo where its
/// files are damaged or nothing can be written. [main]
[[nodiscard]] Result<void> write_report(const std::filesystem::path& run, Host& host);

/// Writes summary.json and, where there is a table for a spreadsheet, table.csv into the folder of
/// a run, then the report of it, which shows the results and the configuration that lie there.
[[nodiscard]] Result<void> save_outcome(const ExperimentOutcome& outcome,
                                        const std::filesystem::path& run, Host& host);

/// Runs of one type of experiment, side by side.
struct ComparedRuns {
  std::vector<std::string> header;  ///< "run", "configuration", what is compared, "commit".
  std::vector<std::vector<std::string>> rows;
  std::vector<std::size_t> runs;  ///< Which run each row is of.
};
/// What compare_runs() shows, a table a type. Fails as write_report() does.
[[nodiscard]] Result<std::vector<ComparedRuns>> compared_rows(
    const std::vector<std::filesystem::path>& runs, Host& host);

/// A table that compares several runs, for a terminal; and the same as a self-contained page in
/// `html`, which may be empty for none. Fails as write_report() does.
[[nodiscard]] Result<std::string> compare_runs(const std::vector<std::filesystem::path>& runs,
                                               const std::filesystem::path& html, Host& host);

/// Whether each of these folders holds a shard of a run.
[[nodiscard]] bool are_shards(const std::vector<std::filesystem::path>& runs);

/// Puts shards of one run together in the folder `out`: the same files, but for times, that the run
/// would have left there as a whole. Some may be missing, which the outcome says. Fails with
/// kConfig where they are not of one run, by one build, each once, and as write_report() does.
[[nodiscard]] Result<ExperimentOutcome> merge_shards(const std::vector<std::filesystem::path>& runs,
                                                     const std::filesystem::path& out, Host& host);

/// The reference page of results, in Markdown: for each experiment whose results have rows, the
/// keys of a row and what they say.
[[nodiscard]] Result<std::string> results_markdown(Host& host);

}  // namespace sidestep
