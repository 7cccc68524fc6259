#include <sidestep/planning/inverse_kinematics.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/planning/goal.hpp>

#include "residual_groups.hpp"

namespace sidestep {
namespace {

constexpr double kTurn_rad = 2.0 * std::numbers::pi;
constexpr double kAbout_m = 2.0;  ///< Seeds of a joint that slides without limits.
constexpr int kMostSteps = 60;
/// Where the goal is met so closely, a descent ends, in standard deviations.
constexpr double kClose = 0.01;
/// One that lowered its cost by less than this share in so many steps ends in the wrong place.
constexpr double kLeastProgress = 0.1;
constexpr int kPatience = 6;
constexpr double kSame = 0.1;  ///< m or rad, of each joint.

bool is_bounded(const Joint& joint) {
  return std::isfinite(joint.lower) && std::isfinite(joint.upper);
}

bool turns_freely(const Joint& joint) {
  return joint.type != Joint::Type::kPrismatic && std::isinf(joint.lower) &&
         std::isinf(joint.upper);
}

/// At full speed.
double time_between_s(const RobotDescription& robot, const Eigen::VectorXd& a,
                      const Eigen::VectorXd& b) {
  double longest_s = 0.0;
  for (Eigen::Index j = 0; j < a.size(); ++j) {
    longest_s = std::max(longest_s, std::abs(a[j] - b[j]) / robot.joints[idx(j)].max_velocity);
  }
  return longest_s;
}

}  // namespace

InverseKinematics::InverseKinematics(const Problem& problem, std::uint64_t seed)
    : robot_(problem.robot),
      start_(problem.start.q),
      goal_(problem.goal.q),
      lower_(start_.size()),
      upper_(start_.size()),
      random_(derive_seed(seed, "inverse_kinematics")),
      at_rest_(Eigen::VectorXd::Zero(start_.size())),
      nearest_cost_(std::numeric_limits<double>::infinity()) {
  const std::vector<Joint>& joints = robot_->description().joints;
  for (Eigen::Index j = 0; j < start_.size(); ++j) {
    lower_[j] = joints[idx(j)].lower;
    upper_[j] = joints[idx(j)].upper;
  }
  Eigen::Index rows = 0;
  for (const CostTerm& term : problem.terms) {
    if (!decides_goal(term)) continue;
    Term added{term.cost, {}};
    for (const ResidualGroup& group : residual_groups(*term.cost)) {
      added.groups.emplace_back();
      for (const std::size_t row : group.rows) {
        added.groups.back().push_back(rows + static_cast<Eigen::Index>(row));
      }
    }
    rows += term.cost->residual_count();
    terms_.push_back(std::move(added));
  }
  residuals_.resize(rows);
  jacobian_.resize(rows, start_.size());
}

Eigen::VectorXd InverseKinematics::next() {
  draw();
  return finish();
}

Eigen::VectorXd InverseKinematics::from(const Eigen::VectorXd& seed) {
  q_ = seed.cwiseMax(lower_).cwiseMin(upper_);
  return finish();
}

Eigen::VectorXd InverseKinematics::finish() {
  descend();
  const double cost = measure(q_, false);
  if (cost < nearest_cost_) {
    nearest_cost_ = cost;
    nearest_ = q_;
  }
  if (!(worst_sigmas() <= kGoalToleranceSigmas)) return {};
  const std::vector<Joint>& joints = robot_->description().joints;
  for (Eigen::Index j = 0; j < q_.size(); ++j) {
    if (!turns_freely(joints[idx(j)])) continue;
    q_[j] = start_[j] + std::remainder(q_[j] - start_[j], kTurn_rad);
  }
  return q_;
}

void InverseKinematics::draw() {
  const int seed = seeds_++;
  if (seed < 2) {
    q_ = (seed == 0 ? goal_ : start_).cwiseMax(lower_).cwiseMin(upper_);
    return;
  }
  const std::vector<Joint>& joints = robot_->description().joints;
  for (Eigen::Index j = 0; j < q_.size(); ++j) {
    const Joint& joint = joints[idx(j)];
    const double about = joint.type == Joint::Type::kPrismatic ? kAbout_m : std::numbers::pi;
    const double low = is_bounded(joint) ? joint.lower : std::max(joint.lower, goal_[j] - about);
    const double high = is_bounded(joint) ? joint.upper : std::min(joint.upper, goal_[j] + about);
    q_[j] =
        std::uniform_real_distribution<double>(std::min(low, high), std::max(low, high))(random_);
  }
}

/// Residuals, and where they are wanted their derivatives, at rest; the cost.
double InverseKinematics::measure(const Eigen::VectorXd& q, bool with_jacobian) {
  const double time_s = 0.0;
  const StateBatch state{
      1, static_cast<int>(q.size()), as_span(q), as_span(at_rest_), {&time_s, 1}};
  const std::span residuals(residuals_.data(), idx(residuals_.size()));
  const std::span jacobian(jacobian_.data(), idx(jacobian_.size()));
  std::size_t row = 0;
  for (const Term& term : terms_) {
    const std::size_t count = idx(term.cost->residual_count());
    CostBatch out{residuals.subspan(row, count), {}, {}};
    if (with_jacobian) {
      out.jacobian_q = jacobian.subspan(row * idx(q.size()), count * idx(q.size()));
    }
    term.cost->evaluate(state, out, scratch_);
    row += count;
  }
  return 0.5 * residuals_.squaredNorm();
}

double InverseKinematics::worst_sigmas() const {
  double worst = 0.0;
  for (const Term& term : terms_) {
    for (const auto& rows : term.groups) worst = std::max(worst, residuals_(rows).norm());
  }
  return residuals_.allFinite() ? worst : std::numeric_limits<double>::infinity();
}

void InverseKinematics::descend() {
  double cost = measure(q_, true);
  double damping = 1.0;
  double earlier_cost = cost;
  for (int step = 1; step <= kMostSteps && cost > kClose * kClose; ++step) {
    if (!std::isfinite(cost)) return;
    if (step % kPatience == 0) {
      if (cost > (1.0 - kLeastProgress) * earlier_cost) return;
      earlier_cost = cost;
    }
    gradient_.noalias() = jacobian_.transpose() * residuals_;
    normal_.noalias() = jacobian_.transpose() * jacobian_;
    // A joint at a limit that the descent would press against stays there.
    for (Eigen::Index j = 0; j < q_.size(); ++j) {
      const bool is_held =
          (q_[j] <= lower_[j] && gradient_[j] > 0.0) || (q_[j] >= upper_[j] && gradient_[j] < 0.0);
      if (!is_held) continue;
      gradient_[j] = 0.0;
      normal_.row(j).setZero();
      normal_.col(j).setZero();
    }
    bool is_lower = false;
    for (; !is_lower && damping < 1e6; damping *= is_lower ? 0.5 : 8.0) {
      damped_ = normal_;
      damped_.diagonal().array() += damping * cost + 1e-9 * normal_.diagonal().maxCoeff() + 1e-12;
      factors_.compute(damped_);
      candidate_ = (q_ - factors_.solve(gradient_)).cwiseMax(lower_).cwiseMin(upper_);
      const double there = measure(candidate_, true);
      is_lower = there < cost;
      if (is_lower) cost = there;
    }
    if (!is_lower) return;
    q_.swap(candidate_);
  }
}

GoalConfigurations find_goals(const Problem& problem, const GoalSearch& how, std::uint64_t seed,
                              const std::function<std::string(std::span<const double>)>& blocked,
                              const Deadline& deadline) {
  const RobotDescription& robot = problem.robot->description();
  InverseKinematics kinematics(problem, seed);
  GoalConfigurations found;
  std::string why_blocked;
  const auto is_known = [&](const Eigen::VectorXd& q) {
    return std::ranges::any_of(found.q, [&](const Eigen::VectorXd& other) {
      return (q - other).lpNorm<Eigen::Infinity>() <= kSame;
    });
  };
  while (found.q.size() < how.wanted && !deadline.expired() &&
         kinematics.seeds() < (found.q.empty() ? how.most_seeds : how.seeds)) {
    const Eigen::VectorXd q = kinematics.next();
    if (q.size() == 0 || is_known(q)) continue;
    std::string why = blocked(as_span(q));
    if (why.empty()) {
      found.q.push_back(q);
    } else {
      why_blocked = std::move(why);
    }
  }
  std::ranges::sort(found.q, {}, [&](const Eigen::VectorXd& q) {
    return time_between_s(robot, problem.start.q, q);
  });
  found.nearest = kinematics.nearest();
  if (!found.q.empty()) return found;
  const std::string when = deadline.expired() ? "when time ran out, of " : "of ";
  const std::string seeds =
      when + std::to_string(kinematics.seeds()) + " searches within the joints' limits none ";
  if (!why_blocked.empty()) {
    found.reason = seeds +
                   "ends in a configuration that reaches the goal and is free; the last that "
                   "reaches it " +
                   why_blocked;
  } else if (kinematics.nearest().size() > 0) {
    found.reason = seeds + "reaches the goal; the nearest ends with " +
                   goal_miss(problem, as_span(kinematics.nearest()));
  } else {
    found.reason = "there was no time to look for a configuration that reaches the goal";
  }
  return found;
}

}  // namespace sidestep
