#include "simulated_robot.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/rolling.hpp>

namespace sidestep::simulated {
namespace {

constexpr double kStep_s = SimulatedRobot::kStep_ns * 1e-9;
/// With which a joint makes up for a small error of its position.
constexpr double kGain_per_s = 50.0;
/// Of the acceleration limit, that a joint keeps to brake with when it makes up for a large one.
constexpr double kBrakingShare = 0.5;

std::span<double> values(Eigen::VectorXd& vector) {
  return {vector.data(), static_cast<std::size_t>(vector.size())};
}

/// The velocity, beside that of the reference, with which to make up for an error: such that it
/// can be braked away until the error is gone.
double catch_up_velocity(double error, double acceleration) {
  const double distance = std::abs(error);
  const double brakeable = std::sqrt(2.0 * kBrakingShare * acceleration * distance);
  return std::copysign(std::min(kGain_per_s * distance, brakeable), error);
}

void sample(const Trajectory& trajectory, Stamp start, Stamp at, Eigen::VectorXd& q,
            Eigen::VectorXd& qdot) {
  const double time_s = static_cast<double>(at.ns - start.ns) * 1e-9;
  trajectory.sample(time_s, values(q), values(qdot));
  if (time_s < 0.0 || time_s > trajectory.duration_s()) qdot.setZero();
}

}  // namespace

SimulatedRobot::SimulatedRobot(MotionLimits limits, double lag_s, Eigen::VectorXd q, Stamp at)
    : limits_(std::move(limits)), lag_s_(lag_s), step_(at.ns / kStep_ns) {
  if (at.ns < step_ * kStep_ns) --step_;
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(q.size());
  state_ = {std::move(q), rest};
  told_ = reference_ = next_ = {state_.q, rest};
}

void SimulatedRobot::enqueue(Command command) {
  std::erase_if(pending_, [&](const Command& other) { return other.from >= command.from; });
  pending_.push_back(std::move(command));
}

void SimulatedRobot::follow(std::shared_ptr<const Trajectory> trajectory, Stamp start, Stamp from) {
  enqueue({std::move(trajectory), start, from});
}

void SimulatedRobot::brake(Stamp from) { enqueue({nullptr, {}, from}); }

void SimulatedRobot::activate(Command command) {
  // What the drives were told last, and how far behind it they are, carries over from one
  // trajectory to the next, but not from a stop.
  if (active_.trajectory == nullptr) told_ = reference_ = {state_.q, state_.qdot};
  active_ = std::move(command);
}

void SimulatedRobot::step() {
  const Stamp end{(step_ + 1) * kStep_ns};
  while (!pending_.empty() && pending_.front().from <= end) {
    Command command = std::move(pending_.front());
    pending_.pop_front();
    activate(std::move(command));
  }
  if (active_.trajectory != nullptr) {
    track();
  } else {
    brake_joints();
  }
  ++step_;
}

void SimulatedRobot::track() {
  const Eigen::VectorXd told_before = told_.q;
  sample(*active_.trajectory, active_.start, {(step_ + 1) * kStep_ns}, told_.q, told_.qdot);
  if (lag_s_ == 0.0) {
    next_ = told_;
  } else {
    // lag * x' = told - x over a step in which `told` moves at a constant velocity.
    const double kept = std::exp(-kStep_s / lag_s_);
    const Eigen::VectorXd behind = (told_.q - told_before) * (lag_s_ / kStep_s);
    next_.q = told_.q - behind + (reference_.q - told_before + behind) * kept;
    next_.qdot = (told_.q - next_.q) / lag_s_;
  }
  for (Eigen::Index j = 0; j < state_.q.size(); ++j) track_joint(j, reference_.q[j], next_);
  std::swap(reference_, next_);
}

void SimulatedRobot::track_joint(Eigen::Index joint, double reference_q, const Reference& next) {
  const auto j = static_cast<std::size_t>(joint);
  const double fastest = limits_.velocity[j];
  double& q = state_.q[joint];
  double& velocity = state_.qdot[joint];
  const double wanted =
      std::clamp(next.qdot[joint] + catch_up_velocity(reference_q - q, limits_.acceleration[j]),
                 -fastest, fastest);
  const double gain = limits_.acceleration[j] * kStep_s;
  const double loss = limits_.while_stopping()[j] * kStep_s;
  const double speed = std::abs(velocity);
  // What is left of the step when it has come to rest, it gains speed the other way.
  const double gain_of_loss = gain == loss ? 1.0 : gain / loss;
  const double back = speed >= loss ? speed - loss : speed * gain_of_loss - gain;
  const auto [low, high] =
      velocity < 0.0 ? std::pair(-(speed + gain), -back) : std::pair(back, speed + gain);
  const double reached = std::clamp(wanted, low, high);
  q += 0.5 * (velocity + reached) * kStep_s;
  velocity = reached;
}

void SimulatedRobot::brake_joints() {
  if (limits_.rolling) roll_to_rest();
  for (Eigen::Index joint = 0; joint < state_.q.size(); ++joint) {
    if (limits_.rolling && (joint == limits_.rolling->x || joint == limits_.rolling->y)) continue;
    const double change = limits_.while_stopping()[static_cast<std::size_t>(joint)] * kStep_s;
    double& velocity = state_.qdot[joint];
    const double reached = velocity - std::clamp(velocity, -change, change);
    state_.q[joint] += 0.5 * (velocity + reached) * kStep_s;
    velocity = reached;
  }
}

/// What wheels make of it when all joints lose speed: none across them, and ahead as along x.
void SimulatedRobot::roll_to_rest() {
  const auto [x, y, yaw] = *limits_.rolling;
  const auto speed = base_speed(*limits_.rolling, as_span(state_.q), as_span(state_.qdot));
  const double change = limits_.while_stopping()[idx(x)] * kStep_s;
  const double ahead = speed.ahead_mps - std::clamp(speed.ahead_mps, -change, change);
  const double turn = state_.qdot[yaw] * kStep_s;
  const double middle = state_.q[yaw] + 0.5 * turn, end = state_.q[yaw] + turn;
  const double way_m = 0.5 * (speed.ahead_mps + ahead) * kStep_s;
  state_.q[x] += way_m * std::cos(middle);
  state_.q[y] += way_m * std::sin(middle);
  state_.qdot[x] = ahead * std::cos(end);
  state_.qdot[y] = ahead * std::sin(end);
}

bool SimulatedRobot::is_settled() const {
  return pending_.empty() && active_.trajectory == nullptr && state_.qdot.isZero(0.0);
}

Eigen::VectorXd SimulatedRobot::told_position(Stamp at) const {
  const auto later = std::ranges::find_if(pending_.rbegin(), pending_.rend(),
                                          [&](const Command& c) { return c.from <= at; });
  const Command& command = later == pending_.rend() ? active_ : *later;
  if (command.trajectory != nullptr) {
    Eigen::VectorXd q(state_.q.size()), qdot(state_.q.size());
    sample(*command.trajectory, command.start, at, q, qdot);
    return q;
  }
  SimulatedRobot ahead = *this;
  while (ahead.time() < at && !ahead.is_settled()) ahead.step();
  return ahead.state_.q;
}

}  // namespace sidestep::simulated
