#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/planning/executor.hpp>
#include <sidestep/planning/prediction.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/runtime/replanner.hpp>
#include <sidestep/runtime/snapshot_slot.hpp>
#include <sidestep/trajectory/motion_limits.hpp>

namespace sidestep {

/// What the planning side asked of its executor, once.
struct ExecutorCall {
  enum class Kind { kCurrent, kFollow, kStop };
  Kind kind = Kind::kCurrent;
  bool succeeded = false;
  std::optional<Executor::Measured> measured = {};         ///< Of kCurrent.
  std::shared_ptr<const Trajectory> trajectory = nullptr;  ///< Of kFollow.
  Stamp start = {};                                        ///< Of kFollow.
};

/// One step of a replanner as it is seen from outside: what it was given, did and told.
struct LoopStep {
  Stamp now;
  double took_s = 0.0;  ///< Wall time.
  bool is_end = false;  ///< It was Replanner::stop().
  Replanner::Status status = Replanner::Status::kWaiting;
  std::vector<ReplannerEvent> events;
  std::vector<ExecutorCall> calls;             ///< In order.
  std::shared_ptr<const Trajectory> followed;  ///< After it; null where nothing is.
  Stamp followed_start;
  Eigen::VectorXd goal;
  std::int64_t checks = 0;                       ///< Validity checks so far.
  MapSnapshot map;                               ///< The newest as it began.
  bool has_new_map = false;                      ///< Another one came while it lasted.
  std::shared_ptr<const Prediction> prediction;  ///< Null where nothing is predicted.
};

/// A statement about every step of the closed loop.
struct LoopPolicy {
  std::string_view name;
  std::string_view promise;  ///< What it guards, in the words of docs/closed_loop.md.
};

/// A policy that a step has broken.
struct PolicyBreach {
  std::string_view policy;
  Stamp stamp;
  std::string what;
};

/// Holds each step of a replanner against what docs/closed_loop.md promises. It shares no check
/// with the replanner: motions are looked at state by state, every 20 ms. One thread.
class LoopPolicies {
 public:
  LoopPolicies(std::shared_ptr<const RobotModel> robot, MotionLimits limits, SpacePolicy space,
               ReplannerSettings settings);
  LoopPolicies(LoopPolicies&& other) noexcept;
  ~LoopPolicies();

  [[nodiscard]] static std::vector<LoopPolicy> all();

  /// The policies that the next step of a run has broken. Allocates.
  [[nodiscard]] std::vector<PolicyBreach> judge(const LoopStep& step);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// An executor that notes what it is asked for, and passes it on to another one.
class NotedExecutor final : public Executor {
 public:
  explicit NotedExecutor(Executor& executor) : executor_(executor) {}

  Result<Measured> current() override;
  Result<void> follow(const Trajectory& trajectory, Stamp start) override;
  Result<void> stop() override;
  [[nodiscard]] Executor& noted() const noexcept { return executor_; }
  /// Hands over what it was asked since the last time. [planning]
  [[nodiscard]] std::vector<ExecutorCall> take_calls();

 private:
  template <class Ask>
  auto noted(ExecutorCall& call, Ask ask);

  Executor& executor_;
  std::mutex mutex_;
  std::vector<ExecutorCall> calls_;
};

/// Steps a replanner that moves its robot by executor(), and holds each step against the policies,
/// if there are any.
class JudgedLoop {
 public:
  /// `executor` and `slot` outlive it.
  JudgedLoop(std::optional<LoopPolicies> policies, Executor& executor, const SnapshotSlot& slot)
      : policies_(std::move(policies)), executor_(executor), slot_(slot) {}

  [[nodiscard]] Executor& executor() noexcept { return policies_ ? executor_ : executor_.noted(); }
  /// Replanner::step(). [planning]
  Replanner::Status step(Replanner& replanner, Stamp now, std::vector<ReplannerEvent>& events);
  /// Replanner::stop(), as the last step. [planning]
  void stop(Replanner& replanner, Stamp now, const std::string& cause,
            std::vector<ReplannerEvent>& events);

  /// The first breaches, kMost of each policy, in order.
  [[nodiscard]] const std::vector<PolicyBreach>& breaches() const noexcept { return breaches_; }
  static constexpr int kMost = 3;
  /// The newest step; of tests.
  [[nodiscard]] const LoopStep& last() const noexcept { return step_; }

 private:
  void begin(Stamp now);
  void end(const Replanner& replanner, std::span<const ReplannerEvent> events);

  std::optional<LoopPolicies> policies_;
  NotedExecutor executor_;
  const SnapshotSlot& slot_;
  LoopStep step_;
  Stopwatch watch_;
  std::vector<PolicyBreach> breaches_;
};

}  // namespace sidestep
