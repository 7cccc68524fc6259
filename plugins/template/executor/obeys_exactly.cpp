// An executor: a simulated robot that is where its trajectory has it, at all times of the run's
// clock, without delay or lag.

#include "obeys_exactly.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/splice.hpp>

namespace obeys_exactly {
namespace {

using namespace sidestep;

class ObeysExactly final : public Executor {
 public:
  ObeysExactly(const Options& options, const Eigen::VectorXd& q, const HostContext& context)
      : options_(options),
        robot_(context.robot),
        clock_(context.clock),
        motion_(context.motion ? context.motion : std::make_shared<RobotMotion>()) {
    const Stamp now = clock_.now();
    parts_.push_back({now, now, resting(as_span(q), 1.0)});
    report(now);
  }

  Result<Measured> current() override {
    const std::lock_guard lock(mutex_);
    const Stamp now = bring_forward();
    return Measured{at(now), now};
  }

  Result<void> follow(const Trajectory& trajectory, Stamp start) override {
    // A robot cannot do everything: who plans has to be told, for it goes on as it was.
    SIDESTEP_TRY(trajectory.validate());
    SIDESTEP_TRY(check_speed(trajectory));
    const std::lock_guard lock(mutex_);
    const Stamp from = std::max(start, bring_forward());
    const Part next{from, start, trajectory};
    SIDESTEP_TRY(check_begin(state(next, from).q, at(from).q));
    begin(next);
    motion_->follow(trajectory, start);
    return {};
  }

  /// Called by whoever is worried, on any thread.
  Result<void> stop() override {
    const std::lock_guard lock(mutex_);
    const Stamp now = bring_forward();
    const RobotState here = at(now);
    const MotionLimits limits = motion_limits(robot_->description(), {});
    const Part& part = part_at(now);
    // On its path, which is known to be clear, where that is long enough to stop on.
    auto braking = here.qdot.isZero() ? Result<Trajectory>(resting(as_span(here.q), 1.0))
                                      : brake(part.trajectory, since(part.start, now), limits);
    if (!braking) braking = brake_straight(here, limits);
    begin({now, now, SIDESTEP_TRY(std::move(braking))});
    motion_->follow({}, now);
    return {};
  }

 private:
  /// What is followed from a time on; `start` is time 0 of the trajectory.
  struct Part {
    Stamp from;
    Stamp start;
    Trajectory trajectory;
  };

  static double since(Stamp start, Stamp stamp) {
    return static_cast<double>(stamp.ns - start.ns) * 1e-9;
  }
  static RobotState state(const Part& part, Stamp stamp) {
    RobotState state{Eigen::VectorXd(part.trajectory.dof), Eigen::VectorXd(part.trajectory.dof)};
    const double time_s = since(part.start, stamp);
    part.trajectory.sample(time_s, as_span(state.q), as_span(state.qdot));
    if (time_s > part.trajectory.duration_s()) state.qdot.setZero();
    return state;
  }
  const Part& part_at(Stamp stamp) const {
    const auto later = std::ranges::upper_bound(parts_, stamp, {}, &Part::from);
    return later == parts_.begin() ? *later : *std::prev(later);
  }
  RobotState at(Stamp stamp) const { return state(part_at(stamp), stamp); }

  /// In place of all that was to be followed then.
  void begin(Part part) {
    std::erase_if(parts_, [&](const Part& other) { return other.from >= part.from; });
    parts_.push_back(std::move(part));
  }

  /// Reports what was measured since the last call, often enough for the pose of a camera, and
  /// forgets what was followed before.
  Stamp bring_forward() {
    constexpr std::int64_t kEvery_ns = 5'000'000;
    const Stamp now = clock_.now();
    while (reported_.ns + kEvery_ns < now.ns) report({reported_.ns + kEvery_ns});
    report(now);
    while (parts_.size() > 1 && parts_[1].from <= now) parts_.erase(parts_.begin());
    return now;
  }
  void report(Stamp stamp) {
    motion_->record(at(stamp), stamp);
    reported_ = stamp;
  }

  Result<void> check_speed(const Trajectory& trajectory) const {
    const auto& joints = robot_->description().joints;
    if (trajectory.dof != std::ssize(joints)) return invalid("it is not of this robot's joints");
    std::vector<double> q(joints.size()), qdot(joints.size());
    for (double time_s = 0.0; time_s <= trajectory.duration_s(); time_s += 0.005) {
      trajectory.sample(time_s, q, qdot);
      for (std::size_t j = 0; j < joints.size(); ++j) {
        if (std::abs(qdot[j]) <= joints[j].max_velocity * (1.0 + options_.velocity_tolerance)) {
          continue;
        }
        return invalid("joint '" + joints[j].name + "' cannot move as fast as at " +
                       std::to_string(time_s) + " s");
      }
    }
    return {};
  }

  Result<void> check_begin(const Eigen::VectorXd& told, const Eigen::VectorXd& is) const {
    Eigen::Index joint = 0;
    if ((told - is).cwiseAbs().maxCoeff(&joint) <= options_.start_tolerance) return {};
    return invalid("joint '" + robot_->description().joints[idx(joint)].name + "' is at " +
                   std::to_string(is[joint]) + ", not at " + std::to_string(told[joint]));
  }

  Options options_;
  std::shared_ptr<const RobotModel> robot_;
  const Clock& clock_;
  std::shared_ptr<RobotMotion> motion_;
  std::mutex mutex_;  ///< Of what follows.
  std::vector<Part> parts_;
  Stamp reported_;
};

}  // namespace

Result<std::unique_ptr<Executor>> create(const Options& options, const HostContext& context) {
  if (context.robot == nullptr) return fail(ErrorCode::kUnsupported, "there is no robot to move");
  const RobotDescription& robot = context.robot->description();
  Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.dof());
  for (const auto& [name, mark, value] : options.start.entries()) {
    const auto joint = robot.joint_index(name);
    if (!joint) {  // an error of a Node has its place in the file
      return tl::make_unexpected(
          value.error("robot '" + robot.name + "' has no joint '" + name + "'"));
    }
    q[*joint] = SIDESTEP_TRY(value.as_double());
  }
  return std::make_unique<ObeysExactly>(options, q, context);
}

}  // namespace obeys_exactly

SIDESTEP_PLUGIN(sidestep::Executor, obeys_exactly::Options, obeys_exactly::create, "obeys_exactly",
                "0.1.0", "A robot where its trajectory has it: an example of a plugin")
