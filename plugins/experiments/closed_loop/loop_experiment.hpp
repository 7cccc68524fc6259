#pragma once

#include <functional>
#include <optional>
#include <string>

#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/experiment.hpp>
#include "replan_rows.hpp"
#include "replan_settings.hpp"

/// What the experiments of the closed loop, `replan` and `deploy`, have in common.

namespace sidestep {

/// What both read of a configuration, and how their runs are shown.
class LoopExperiment : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override;
  [[nodiscard]] const report::RunReport& report() const override;
};

/// Appends the mistakes in the names of links that both read.
void check_loop_names(const Configuration& configuration, const RobotDescription& robot,
                      std::vector<Error>& errors);

/// What a run of a closed loop is, beyond its rows.
struct ReplanFacts {
  RunProvenance provenance;
  std::string experiment = "replan";  ///< Its type.
  report::Json about;                 ///< With what clock, robot, limits and optimiser it is run.
  int planned_episodes = 0;           ///< 0: as many as there are.
  /// The command that runs it again, up to which of its episodes; empty where none can be run by
  /// itself.
  std::string again;
  bool interrupted = false;
  std::optional<Error> fault;  ///< That ended it early.
};

/// What a context and its settings say of them.
[[nodiscard]] ReplanFacts facts_of(const ExperimentContext& context,
                                   const ReplanConfiguration& settings,
                                   const RobotDescription& robot);

/// The command that runs a configuration again, overrides included.
[[nodiscard]] std::string command_again(const Configuration& configuration);

/// Does the work with a recorder of the run's results store, new or gone on with, and concludes
/// from what it committed, even where it failed. Fails with that where there is not one episode.
/// `identity` is kept in a new store, see record_replan_run().
[[nodiscard]] Result<ExperimentOutcome> run_loop(
    const ExperimentContext& context, ReplanFacts facts, const std::string& identity,
    const std::function<Result<void>(Recorder& recorder)>& work);

/// Verdict, summary.json and table of a finished (or interrupted) run.
[[nodiscard]] ExperimentOutcome summarise_replan(const ReplanFacts& facts, const ReplanRows& rows);

/// Result of a run: keys of summary.json, and how they are shown.
[[nodiscard]] const report::ResultColumnsOf<ReplanRows>& replan_metrics();

}  // namespace sidestep
