#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <sidestep/robot/robot_model.hpp>
#include <sidestep/runtime/experiment.hpp>

#include "replan_rows.hpp"
#include "replan_summary.hpp"

/// What the experiments of the closed loop, `replan` and `deploy`, have in common.

namespace sidestep {

/// What both read of a configuration, and how their runs are shown.
class LoopExperiment : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override;
  [[nodiscard]] const report::RunReport& report() const override;
};

/// Reads what is an experiment's own, for this robot, and appends the mistakes in it.
using CheckOwn =
    std::function<void(const std::shared_ptr<const RobotModel>& robot, std::vector<Error>& errors)>;

/// Appends all mistakes in a configuration that no schema knows of.
void check_loop(const Configuration& configuration, Host& host, const CheckOwn& check_own,
                std::vector<Error>& errors);

/// Does the work with a recorder of the run's results store, new or gone on with, and concludes
/// from what it committed, even where it failed. `identity` is kept in a new store, see
/// record_replan_run().
[[nodiscard]] Result<ExperimentOutcome> run_loop(
    const ExperimentContext& context, ReplanFacts facts, const std::string& identity,
    const std::function<Result<void>(Recorder& recorder)>& work);

}  // namespace sidestep
