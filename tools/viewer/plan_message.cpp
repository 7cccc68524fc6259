#include <algorithm>
#include <cmath>

#include "message_bytes.hpp"
#include "view_messages.hpp"

namespace sidestep {
namespace {

constexpr double kPathStep_s = 0.05;
constexpr int kMostPathSamples = 400;
constexpr int kMostSwept = 24;

/// `count` times from 0 to the end, evenly.
std::vector<double> times_of(double duration_s, int count) {
  std::vector<double> times_s;
  for (int i = 0; i < count; ++i) times_s.push_back(duration_s * i / std::max(1, count - 1));
  return times_s;
}

/// Where a robot is along a trajectory.
class PosesAlong {
 public:
  PosesAlong(const RobotModel& robot, const Trajectory& trajectory)
      : robot_(robot),
        trajectory_(trajectory),
        q_(static_cast<std::size_t>(trajectory.dof)),
        T_world_link_(robot.description().links.size()) {}

  const std::vector<Transform>& at(double time_s) {
    trajectory_.sample(time_s, q_, {});
    robot_.link_poses(q_, T_world_link_, scratch_);
    return T_world_link_;
  }

 private:
  const RobotModel& robot_;
  const Trajectory& trajectory_;
  std::vector<double> q_;
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
};

void add_positions(PosesAlong& along, const std::vector<double>& times_s, int link,
                   Payload& payload) {
  for (const double time_s : times_s) {
    payload.add(Eigen::Vector3d(along.at(time_s)[static_cast<std::size_t>(link)].translation()));
  }
}

}  // namespace

ViewMessage plan_message(Stamp time, std::string_view role, const Trajectory& trajectory,
                         Stamp start, const RobotModel& robot) {
  const bool is_empty = trajectory.size() == 0;
  const double duration_s = trajectory.duration_s();
  const int steps =
      static_cast<int>(std::min(std::ceil(duration_s / kPathStep_s), kMostPathSamples - 1.0));
  const std::vector<double> times_s = times_of(duration_s, is_empty ? 0 : steps + 1);
  const std::vector<double> swept_s =
      times_of(duration_s, is_empty ? 0 : std::min(steps + 1, kMostSwept));
  Payload payload;
  PosesAlong along(robot, trajectory);
  add_positions(along, times_s, tool_link(robot.description()), payload);
  add_positions(along, times_s, base_link(robot.description()), payload);
  for (const double swept : swept_s) {
    for (const Transform& pose : along.at(swept)) payload.add(pose);
  }
  return make_message(
      ViewKind::kPlan, time,
      {{"role", role}, {"start_s", start.seconds()}, {"times_s", times_s}, {"swept_s", swept_s}},
      payload);
}

}  // namespace sidestep
