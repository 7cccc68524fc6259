#include "tool_line.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/planning/cost_form.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/planning/inverse_kinematics.hpp>

namespace sidestep::tool_line {
namespace {

constexpr double kSigma_m = 1e-4;  ///< Of states on the line: inverse kinematics ends far within.
constexpr double kSigma_rad = 1e-3;
constexpr int kLeastSteps = 8;
constexpr int kMostSteps = 20'000;
constexpr int kLooksPerStep = 5;  ///< Between two states, at how far the link is off the line.

/// From rest to rest: the share of the line at a share of the time.
double share_at(double time) { return time * time * (3.0 - 2.0 * time); }

/// Where the link is to be.
class Line {
 public:
  Line(const Transform& from, const Transform& to) : from_(from), to_(to) {
    turn_ = Eigen::AngleAxisd(from.linear().transpose() * to.linear());
    way_m_ = to.translation() - from.translation();
  }

  [[nodiscard]] double length_m() const { return way_m_.norm(); }
  [[nodiscard]] double turn_rad() const { return std::abs(turn_.angle()); }
  [[nodiscard]] Transform at(double share) const {
    if (share >= 1.0) return to_;
    Transform pose = from_;
    pose.translation() += share * way_m_;
    pose.rotate(Eigen::AngleAxisd(share * turn_.angle(), turn_.axis()));
    return pose;
  }
  /// How far a pose is off the line, in m and rad, where it is `share` of it on, or where it is
  /// nearest to it if the link does more than turn.
  [[nodiscard]] std::pair<double, double> off(const Transform& pose, double share) const {
    if (length_m() > 1e-6) {
      const Eigen::Vector3d on = pose.translation() - from_.translation();
      share = std::clamp(on.dot(way_m_) / way_m_.squaredNorm(), 0.0, 1.0);
    }
    const Transform there = at(share);
    const Eigen::AngleAxisd turn(there.linear().transpose() * pose.linear());
    return {(pose.translation() - there.translation()).norm(), std::abs(turn.angle())};
  }

 private:
  Transform from_, to_;
  Eigen::AngleAxisd turn_;
  Eigen::Vector3d way_m_;
};

Solution no_path(std::string reason) {
  Solution solution;
  solution.status = SolveStatus::kNoPath;
  solution.reason = std::move(reason);
  return solution;
}

/// The one pose or position that is the goal; nothing where there is none, or more.
std::optional<LinkPoseForm> target_of(const Problem& problem) {
  std::optional<LinkPoseForm> target;
  for (const CostTerm& term : problem.terms) {
    if (!decides_goal(term)) continue;
    const auto* described = dynamic_cast<const HasCostForm*>(term.cost.get());
    if (described == nullptr || target) return std::nullopt;
    const CostForm form = described->form();
    const auto* pose = std::get_if<LinkPoseForm>(&form);
    if (pose == nullptr || pose->targets.size() != 1 || pose->position_weight == 0.0) {
      return std::nullopt;
    }
    target = *pose;
  }
  return target;
}

class ToolLine final : public Optimiser {
 public:
  ToolLine(const Options& options, Log& log) : options_(options), log_(log) {}

  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory&,
                                       const Deadline& deadline) override {
    const Stopwatch watch;
    SIDESTEP_TRY(problem.validate());
    const auto target = target_of(problem);
    Solution solution;
    if (!is_goal_free(problem) || !target) {
      solution = no_path(
          "a straight line of a link leads to one pose or position of it: give an `end_effector` "
          "without alternatives or an axis, and no other cost at the goal");
    } else {
      if (!problem.start.qdot.isZero(1e-9)) {
        log_.warn("the link moves from rest to rest; the velocity of the start is ignored");
      }
      solution = SIDESTEP_TRY(follow(problem, *target, deadline));
    }
    solution.solve_ms = watch.elapsed_ms();
    return solution;
  }

 private:
  [[nodiscard]] Result<Solution> follow(const Problem& problem, const LinkPoseForm& target,
                                        const Deadline& deadline) const {
    const Transform from = pose(problem, target.link, as_span(problem.start.q));
    Transform to = target.targets.front();
    if (target.rotation_weight == 0.0) to.linear() = from.linear();
    const Line line(from, to);
    // The middle of the way is passed half as fast again as its mean.
    const double steps =
        1.5 * std::max(line.length_m() / options_.step_m, line.turn_rad() / options_.step_rad);
    if (steps > kMostSteps) return no_path("the line takes more than 20,000 steps");
    for (int count = std::max(kLeastSteps, static_cast<int>(std::ceil(steps)));; count *= 2) {
      Solution solution = SIDESTEP_TRY(follow_in(problem, target.link, line, count, deadline));
      if (solution.status != SolveStatus::kConverged) return solution;
      const auto [off_m, off_rad] = farthest_off(problem, target.link, line, solution.trajectory);
      if (off_m <= options_.deviation_m && off_rad <= options_.deviation_rad) {
        log_.info("the link is at most " + format("%.3g m", off_m) + " and " +
                  format("%.3g rad", off_rad) + " off its line of " +
                  format("%.4g m", line.length_m()));
        return solution;
      }
      if (2 * count > kMostSteps) {
        return no_path("the link is " + format("%.3g m", off_m) + " and " +
                       format("%.3g rad", off_rad) + " off its line between two states");
      }
    }
  }

  /// States at as many equal times as there are steps, each from the one before.
  [[nodiscard]] Result<Solution> follow_in(const Problem& problem, int link, const Line& line,
                                           int steps, const Deadline& deadline) const {
    const RobotDescription& robot = problem.robot->description();
    const double duration_s = problem.dt_s * (problem.support_states - 1);
    const double dt_s = duration_s / steps;
    Trajectory path = make_trajectory(robot.dof(), steps + 1, dt_s);
    Problem at = problem;
    Eigen::VectorXd q = problem.start.q;
    std::ranges::copy(as_span(q), path.q(0).begin());
    for (int i = 1; i <= steps; ++i) {
      const double share = share_at(static_cast<double>(i) / steps);
      if (deadline.expired()) {
        Solution solution = no_path("the deadline passed" + on_the_way(line, share));
        solution.status = SolveStatus::kDeadline;
        return solution;
      }
      auto there = SIDESTEP_TRY(make_link_pose_cost(problem.robot, robot.links[idx(link)].name,
                                                    line.at(share), kSigma_m, kSigma_rad));
      at.terms = {{std::move(there), Placement::kGoal}};
      at.start.q = q;  // joints that turn without limits stay within half a turn of it
      InverseKinematics kinematics(at, 0);
      const Eigen::VectorXd next = kinematics.from(q);
      if (next.size() == 0) {
        return no_path("the link cannot follow its line" + on_the_way(line, share) +
                       ": it ends with " + goal_miss(at, as_span(kinematics.nearest())) +
                       at_limits(robot, kinematics.nearest()));
      }
      const double jump = (next - q).lpNorm<Eigen::Infinity>();
      if (jump > options_.most_jump) {
        return no_path("a joint would jump by " + format("%.3g", jump) + on_the_way(line, share));
      }
      q = next;
      std::ranges::copy(as_span(q), path.q(i).begin());
    }
    for (int i = 1; i < steps; ++i) {
      for (std::size_t j = 0; j < path.q(i).size(); ++j) {
        path.qdot(i)[j] = (path.q(i + 1)[j] - path.q(i - 1)[j]) / (2.0 * dt_s);
      }
    }
    Solution solution;
    solution.status = SolveStatus::kConverged;
    solution.trajectory = std::move(path);
    solution.iterations = solution.accepted_iterations = steps;
    solution.initial_cost = solution.cost = line.length_m();
    return solution;
  }

  [[nodiscard]] static std::string on_the_way(const Line& line, double share) {
    return " beyond " + format("%.3g", share * line.length_m()) + " of " +
           format("%.3g m", line.length_m());
  }

  /// "; joint 'elbow' is at its limit".
  [[nodiscard]] static std::string at_limits(const RobotDescription& robot,
                                             const Eigen::VectorXd& q) {
    std::string text;
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      const Joint& joint = robot.joints[idx(j)];
      if (q[j] > joint.lower && q[j] < joint.upper) continue;
      text += "; joint '" + joint.name + "' is at its limit";
    }
    return text;
  }

  [[nodiscard]] Transform pose(const Problem& problem, int link, std::span<const double> q) const {
    std::vector<Transform> poses(problem.robot->description().links.size());
    Scratch scratch;
    problem.robot->link_poses(q, poses, scratch);
    return poses[idx(link)];
  }

  [[nodiscard]] std::pair<double, double> farthest_off(const Problem& problem, int link,
                                                       const Line& line,
                                                       const Trajectory& path) const {
    std::pair<double, double> farthest(0.0, 0.0);
    std::vector<double> q(idx(path.dof));
    const int looks = kLooksPerStep * (path.size() - 1);
    for (int i = 0; i <= looks; ++i) {
      const double time = static_cast<double>(i) / looks;
      path.sample(time * path.duration_s(), q, {});
      const auto [off_m, off_rad] = line.off(pose(problem, link, q), share_at(time));
      farthest = {std::max(farthest.first, off_m), std::max(farthest.second, off_rad)};
    }
    return farthest;
  }

  Options options_;
  Log& log_;
};

}  // namespace

Parameters<Options> Options::parameters() {
  using O = Options;
  return Parameters<O>()
      .add("step_m", &O::step_m, "Longest way of the link between two states.",
           {.unit = "m", .min = 1e-5})
      .add("step_rad", &O::step_rad, "Largest turn of the link between two states.",
           {.unit = "rad", .min = 1e-4})
      .add("deviation_m", &O::deviation_m,
           "How far the link may be off its line between two states; there are more states where "
           "it is farther.",
           {.unit = "m", .min = 1e-6})
      .add("deviation_rad", &O::deviation_rad, "Likewise, how far it may be turned otherwise.",
           {.unit = "rad", .min = 1e-5})
      .add("most_jump", &O::most_jump,
           "How far a joint may move between two states, in m or rad: beyond, the robot would "
           "have to change its posture.",
           {.min = 1e-3});
}

std::unique_ptr<Optimiser> make_tool_line(const Options& options, Log& log) {
  return std::make_unique<ToolLine>(options, log);
}

}  // namespace sidestep::tool_line
