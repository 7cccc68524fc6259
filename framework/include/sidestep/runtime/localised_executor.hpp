#pragma once

#include <atomic>
#include <optional>
#include <string>

#include <sidestep/planning/executor.hpp>
#include <sidestep/robot/base_joints.hpp>
#include <sidestep/runtime/snapshot_slot.hpp>

namespace sidestep {

/// An executor whose robot is where a localiser has it, in the map's frame: measured states and
/// trajectories go through the newest map's MapSnapshot::localisation. What is followed is sent
/// again whenever that has moved by 2 mm or 2 mrad, so that the robot keeps to it in the map.
class LocalisedExecutor final : public Executor {
 public:
  /// Both outlive it.
  LocalisedExecutor(Executor& executor, BaseJoints base, const SnapshotSlot& slot)
      : executor_(executor), base_(base), slot_(slot) {}

  /// Fails with kIo where the localiser has lost the robot, and where what is followed lies
  /// elsewhere by 2 cm or 20 mrad and the executor does not take it so.
  Result<Measured> current() override;
  /// The same where the robot is lost, too: for what does not depend on it, such as where to look.
  /// [planning]
  [[nodiscard]] Result<Measured> believed();
  Result<void> follow(const Trajectory& trajectory, Stamp start) override;
  Result<void> stop() override;

 private:
  struct Followed {
    Trajectory trajectory;  ///< In the map's frame.
    Stamp start;
    Transform T_map_odom;  ///< With which it was sent.
  };
  [[nodiscard]] Result<void> send(const Trajectory& trajectory, Stamp start);
  /// Sends what is followed again where it has come to lie elsewhere.
  [[nodiscard]] Result<void> correct(Stamp now);

  Executor& executor_;
  BaseJoints base_;
  const SnapshotSlot& slot_;
  Transform T_map_odom_ = Transform::Identity();
  double turns_rad_ = 0.0;                ///< Whole turns of T_map_odom_.
  std::string lost_;                      ///< Localisation::lost.
  std::optional<Followed> followed_;      ///< [planning] only.
  std::atomic<bool> is_stopped_ = false;  ///< Nothing is sent again after stop().
};

}  // namespace sidestep
