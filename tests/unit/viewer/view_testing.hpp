#pragma once

#include <memory>
#include <string>
#include <vector>

#include <sidestep/field/dense_field.hpp>
#include <sidestep/runtime/run_observer.hpp>

#include "decoded_message.hpp"
#include "support/ball_robot.hpp"
#include "support/chain_robot.hpp"
#include "view_message.hpp"

namespace sidestep::testing_support {

/// Takes what it is handed, as if by pages; wants what a test says.
class ListeningSink final : public ViewSink {
 public:
  Demand wanted{true, true, {}};
  std::vector<ViewMessage> greeting;
  std::vector<ViewMessage> messages;
  std::vector<std::pair<SliceRequest, ViewMessage>> slices;

  [[nodiscard]] Demand demand() override { return wanted; }
  void greet(const std::vector<ViewMessage>& all) override {
    if (!wanted.newcomers) return;
    greeting = all;
    wanted.newcomers = false;
  }
  void publish(const ViewMessage& message) override { messages.push_back(message); }
  void publish_slice(const SliceRequest& request, const ViewMessage& message) override {
    slices.emplace_back(request, message);
  }

  /// Kinds of what came since the last call, in order.
  [[nodiscard]] std::vector<std::string> take_kinds() {
    std::vector<std::string> kinds;
    for (const ViewMessage& message : messages) kinds.emplace_back(to_string(message.kind));
    messages.clear();
    return kinds;
  }
};

/// A grid that no block divides evenly.
[[nodiscard]] inline FieldInfo small_field_info() {
  FieldInfo info;
  info.grid.origin_m = {-1.0, 0.5, 0.25};
  info.grid.resolution_m = 0.1;
  info.grid.size_vox = {35, 18, 20};
  info.max_distance_m = 0.5;
  info.stamp = Stamp::from_seconds(1.5);
  return info;
}

/// The field of a ball at a point: negative inside.
[[nodiscard]] inline std::shared_ptr<const DenseField> ball_field(
    const Eigen::Vector3d& centre_m, const FieldInfo& info = small_field_info()) {
  return make_dense_field(info, [&](const Eigen::Vector3i& voxel) {
    return std::min(info.max_distance_m, (info.grid.centre_m(voxel) - centre_m).norm() - 0.3);
  });
}

/// A ball of 0.2 m that drives below a crossing box, over a floor.
[[nodiscard]] inline ObservedWorld ball_world() {
  ObservedWorld world;
  world.title = "test";
  world.episode = 3;
  world.robot = std::make_shared<const BallRobot>(0.2);
  Transform T_box = Transform::Identity();
  T_box.translation() = Eigen::Vector3d(2.0, 0.0, 1.0);
  Transform T_end = T_box;
  T_end.translation().y() = 4.0;
  world.scene = std::make_shared<const Scene>(std::vector<SceneObject>{
      {"floor", HalfSpace{}, {{0.0, Transform::Identity()}}, false, std::nullopt},
      {"box", Box{{1.0, 1.0, 1.0}}, {{0.0, T_box}, {4.0, T_end}}, false, std::nullopt}});
  world.q_start = Eigen::Vector3d(0.0, 0.0, 1.0);
  world.q_goal = Eigen::Vector3d(1.0, 0.0, 1.0);
  return world;
}

[[nodiscard]] inline ObservedStep step_at(double time_s, double step_ms = 1.0) {
  ObservedStep step;
  step.stamp = Stamp::from_seconds(time_s);
  step.step_ms = step_ms;
  step.status = Replanner::Status::kMoving;
  step.checks = 7;
  step.q = Eigen::Vector3d(time_s, 0.0, 1.0);
  return step;
}

[[nodiscard]] inline ObservedMap map_at(double time_s, std::int64_t sequence,
                                        std::shared_ptr<const DistanceField> field) {
  auto frame = std::make_shared<Frame>();
  frame->sequence = sequence;
  frame->stamp = Stamp::from_seconds(time_s);
  DepthImage image;
  image.camera = {4, 2, 10.0, 10.0, 1.5, 0.5};
  image.depth_m.assign(8, 1.0F);
  frame->measurement = image;
  ObservedMap map;
  map.step.frame_sequence = sequence;
  map.step.stamp = frame->stamp;
  map.step.integrate_ms = 2.0;
  map.step.field_ms = 3.0;
  map.frame = std::move(frame);
  map.snapshot.field = std::move(field);
  map.received = Stamp::from_seconds(time_s + 0.01);
  map.published = Stamp::from_seconds(time_s + 0.02);
  return map;
}

/// A motion of the ball along x, and that it is followed.
[[nodiscard]] inline ObservedEvent plan_at(double time_s, double to_x_m = 1.0) {
  ObservedEvent event;
  event.event.kind = ReplannerEvent::Kind::kPlanned;
  event.event.stamp = Stamp::from_seconds(time_s);
  event.event.guess = "straight_line";
  event.event.tried = {"refit", "straight_line"};
  const RobotState from{Eigen::Vector3d(0.0, 0.0, 1.0), Eigen::Vector3d::Zero()};
  const RobotState to{Eigen::Vector3d(to_x_m, 0.0, 1.0), Eigen::Vector3d::Zero()};
  event.followed = std::make_shared<const Trajectory>(straight_line(from, to, 11, 0.1));
  event.followed_start = Stamp::from_seconds(time_s + 0.1);
  return event;
}

}  // namespace sidestep::testing_support
