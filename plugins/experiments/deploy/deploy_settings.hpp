#pragma once

#include <memory>
#include <string>
#include <vector>

#include <sidestep/planning/goal_source.hpp>

#include "replan_settings.hpp"

namespace sidestep {

/// The `experiment` block of a deploy experiment.
struct DeploySettings : ReplanSettings {
  int goals = 0;
  double feedback_period_s = 0.2;

  DeploySettings() { clock = "wall"; }
  static Parameters<DeploySettings> parameters();
};

/// All that a configuration says of a deploy experiment; goal and task are those of each request.
struct DeployConfiguration {
  DeploySettings deploy;
  ReplanConfiguration loop;
};

/// As read_replan_configuration().
[[nodiscard]] DeployConfiguration read_deploy_configuration(const Configuration& configuration,
                                                            const RobotDescription& robot,
                                                            std::vector<Error>& errors);

/// A request that has been understood.
struct Goal {
  std::string id;
  bool is_stop = false;  ///< Nothing but to come to rest; what follows is empty.
  Eigen::VectorXd q;
  Task task;
};

/// Reads a request of a robot that is at `q_now`. Fails with all mistakes in one message.
[[nodiscard]] Result<Goal> read_goal(const GoalRequest& request,
                                     const std::shared_ptr<const RobotModel>& robot,
                                     const Eigen::VectorXd& q_now);

}  // namespace sidestep
