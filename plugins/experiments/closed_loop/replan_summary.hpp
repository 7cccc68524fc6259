#pragma once

#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "replan_rows.hpp"
#include "replan_settings.hpp"

namespace sidestep {

/// What a replan experiment is, beyond its rows.
struct ReplanFacts {
  RunProvenance provenance;
  std::string experiment = "replan";  ///< Its type.
  std::string clock;
  std::string robot;
  std::string optimiser;     ///< Name of the plugin.
  int planned_episodes = 0;  ///< 0: as many as there are.
  /// The command that runs it again, up to which of its episodes; empty where none can be run by
  /// itself.
  std::string again;
  bool interrupted = false;
  std::optional<Error> fault;  ///< That ended it early.
};

/// What a context and its settings say of them.
[[nodiscard]] ReplanFacts facts_of(const ExperimentContext& context, const ReplanSettings& settings,
                                   const RobotDescription& robot);

/// The command that runs a configuration again, overrides included.
[[nodiscard]] std::string command_again(const Configuration& configuration);

/// Result of a run: keys of summary.json, and how they are shown.
[[nodiscard]] const report::ResultColumnsOf<ReplanRows>& replan_metrics();

/// Verdict, summary.json and table of a finished (or interrupted) replan experiment.
[[nodiscard]] ExperimentOutcome summarise_replan(const ReplanFacts& facts, const ReplanRows& rows);

/// The same of what a run left in its results store; `done` says what ended it early. Fails with
/// that where there is not one episode.
[[nodiscard]] Result<ExperimentOutcome> conclude_replan(ReplanFacts facts, Result<void> done,
                                                        const std::filesystem::path& results);

/// How such runs are shown.
[[nodiscard]] const report::RunReport& replan_report();

}  // namespace sidestep
