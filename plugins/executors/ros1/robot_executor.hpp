#pragma once

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>

#include <sidestep/planning/executor.hpp>
#include <sidestep/planning/map_display.hpp>
#include <sidestep/plugin/context.hpp>
#include <sidestep/trajectory/robot_motion.hpp>

#include "command_stream.hpp"
#include "map_view.hpp"
#include "markers.hpp"
#include "motion_checks.hpp"
#include "robot_link.hpp"
#include "run_time.hpp"
#include "told_motion.hpp"

namespace sidestep::ros1_executor {

/// What an executor consists of, made before it.
struct Parts {
  ros1_node::MasterProbe master;
  JointFeed feed;
  CommandWriter writer;
  MarkerPainter painter;
  std::optional<Gaze> gaze;
};

/// A robot behind ROS 1: its state as topics tell it, motions to its controllers, what RViz shows.
class RobotExecutor : public Executor, public MapDisplay {
 public:
  RobotExecutor(const Options& options, const HostContext& context, Parts parts);
  /// A robot is not left moving.
  ~RobotExecutor() override;

  /// Waits until the robot's state is known and its controllers listen. Fails with kNotFound.
  [[nodiscard]] Result<void> connect();
  Result<Measured> current() override;
  Result<void> follow(const Trajectory& trajectory, Stamp start) override;
  Result<void> stop() override;
  bool wants_map() override { return map_view_.is_wanted(); }
  void show_map(std::shared_ptr<const DistanceField> field) override {
    map_view_.show(std::move(field));
  }

 protected:
  /// roscpp writes messages from a thread of its own, and not once the program has ended.
  static constexpr auto kFlush = std::chrono::milliseconds(50);
  /// Takes messages in, as current() does, also while the robot has nothing to do. Where it is, or
  /// why that is not known.
  Result<Eigen::VectorXd> attend();

 private:
  [[nodiscard]] bool is_shadow() const { return options_.mode == "shadow"; }
  [[nodiscard]] std::optional<Measured> measured() const;
  /// Measured, or in shadow what it would be.
  [[nodiscard]] std::optional<Measured> state_at(Stamp now) const;
  /// Where it will be; nothing where that is not known.
  [[nodiscard]] std::optional<RobotState> expected_at(Stamp then) const;
  [[nodiscard]] bool moves(Stamp now) const;
  /// Nothing was commanded yet, and nothing moves.
  [[nodiscard]] bool stands_by_itself() const;
  void adopt(Trajectory trajectory, Stamp start);
  void compare_held() const;
  void show(Stamp now, const Eigen::VectorXd& q);

  Options options_;
  std::shared_ptr<const RobotModel> robot_;
  const Clock& clock_;
  Log& log_;
  std::shared_ptr<RobotMotion> motion_;
  MotionLimits limits_;
  std::mutex mutex_;
  ros1_node::RunTime time_;
  MarkerPainter painter_;
  RobotLink link_;
  CommandStream commands_;
  MapView map_view_;
  Confirmation confirmation_;
  ToldMotion told_;
  std::optional<Stamp> shown_;
};

}  // namespace sidestep::ros1_executor
