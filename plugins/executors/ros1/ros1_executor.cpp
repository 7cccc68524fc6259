#include "ros1_executor.hpp"

#include <optional>
#include <thread>
#include <utility>

#include <ros/init.h>

#include <sidestep/planning/goal_source.hpp>

#include "conversions.hpp"
#include "goal_topics.hpp"
#include "node.hpp"
#include "refusals.hpp"
#include "robot_executor.hpp"

namespace sidestep::ros1_executor {
namespace {

constexpr double kMasterPeriod_s = 0.5;

/// One that goals come to while the robot runs.
class ErrandExecutor final : public RobotExecutor, public GoalSource {
 public:
  ErrandExecutor(const Options& options, const HostContext& context, Parts parts, GoalWishes wishes)
      : RobotExecutor(options, context, std::move(parts)),
        topics_(options, std::move(wishes), context.log) {}
  ~ErrandExecutor() override { std::this_thread::sleep_for(kFlush); }

  std::optional<GoalRequest> next_goal() override {
    const auto q_now = attend();
    return topics_.next(q_now, ros_messages::to_stamp(::ros::Time::now()));
  }
  void report(const GoalReport& report) override { topics_.report(report); }
  bool is_open() const override { return ::ros::ok(); }

 private:
  GoalTopics topics_;  ///< [planning] only.
};

Result<std::unique_ptr<RobotExecutor>> make_executor(const Options& options,
                                                     const HostContext& context, Parts parts) {
  if (!options.goals) return std::make_unique<RobotExecutor>(options, context, std::move(parts));
  auto wishes = SIDESTEP_TRY(GoalWishes::create(context.robot, options));
  return std::make_unique<ErrandExecutor>(options, context, std::move(parts), std::move(wishes));
}

}  // namespace

Result<std::unique_ptr<Executor>> create_executor(const Options& options,
                                                  const HostContext& context) {
  if (context.robot == nullptr) {
    return fail(ErrorCode::kUnsupported, "there is no robot to move", kWhere);
  }
  const RobotDescription& robot = context.robot->description();
  auto feed = SIDESTEP_TRY(JointFeed::create(robot, options));
  auto writer = SIDESTEP_TRY(CommandWriter::create(robot, options));
  auto painter = SIDESTEP_TRY(
      MarkerPainter::create(context.robot, options.markers.link.value_or(""), options.world_frame));
  std::optional<Gaze> gaze;
  if (options.look) {
    gaze = SIDESTEP_TRY(Gaze::create(robot, *options.odometry, *options.look));
  }
  auto master = SIDESTEP_TRY(ros1_node::join_ros(options.connect_wait_s, kMasterPeriod_s));
  auto executor = SIDESTEP_TRY(make_executor(options, context,
                                             {std::move(master), std::move(feed), std::move(writer),
                                              std::move(painter), std::move(gaze)}));
  SIDESTEP_TRY(executor->connect());
  return std::unique_ptr<Executor>(std::move(executor));
}

}  // namespace sidestep::ros1_executor
