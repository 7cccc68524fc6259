#include <array>
#include <cmath>
#include <limits>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "policy_view.hpp"

namespace sidestep::detail {
namespace {

constexpr double kInstant_s = 0.02;   ///< Between two states that are looked at.
constexpr double kRounding_m = 1e-5;  ///< Field values are floats.
constexpr double kLeaving_m = 2e-3;   ///< What a sphere that leaves an obstacle may be off.
constexpr double kLimitShare = 1.01;  ///< Timings keep limits to within 1 %.
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Where a robot's spheres are along a motion.
class Spheres {
 public:
  explicit Spheres(const PolicyView& view)
      : view_(view),
        all_(view.setup.robot->description().spheres),
        centres_m_(all_.size()),
        distances_m_(all_.size()),
        statuses_(all_.size()) {}

  void place(const Trajectory& motion, double time_s) {
    q_.resize(idx(motion.dof));
    motion.sample(time_s, q_, {});
    Scratch scratch;
    view_.setup.robot->sphere_centres(q_, centres_m_, scratch);
  }
  /// Asks the step's map.
  void ask() {
    query_with_policy(*view_.step.map.field, view_.setup.space, centres_m_, distances_m_, {},
                      statuses_);
  }
  [[nodiscard]] std::size_t size() const { return all_.size(); }
  [[nodiscard]] bool moves(std::size_t s) const { return !view_.setup.fixed[s]; }
  [[nodiscard]] const Eigen::Vector3d& centre_m(std::size_t s) const { return centres_m_[s]; }
  [[nodiscard]] std::span<const Eigen::Vector3d> centres_m() const { return centres_m_; }
  [[nodiscard]] double radius_m(std::size_t s) const { return all_[s].radius_m; }
  [[nodiscard]] double clearance_m(std::size_t s) const {
    return distances_m_[s] - all_[s].radius_m;
  }
  [[nodiscard]] FieldStatus status(std::size_t s) const { return statuses_[s]; }
  [[nodiscard]] const std::string& link(std::size_t s) const {
    return view_.setup.robot->description().links[idx(all_[s].link)].name;
  }

 private:
  const PolicyView& view_;
  const std::vector<CollisionSphere>& all_;
  std::vector<double> q_;
  std::vector<Eigen::Vector3d> centres_m_;
  std::vector<double> distances_m_;
  std::vector<FieldStatus> statuses_;
};

/// Times from `from_s` to `to_s`, both included.
std::vector<double> instants(double from_s, double to_s) {
  std::vector<double> times_s;
  for (double time_s = from_s; time_s < to_s; time_s += kInstant_s) times_s.push_back(time_s);
  times_s.push_back(to_s);
  return times_s;
}

/// What of the map moves, and how far it may have come when a map is asked that long after it.
bool reaches(const PolicyView& view, Spheres& spheres, double after_now_s) {
  const MovingObstacles& moving = *view.step.map.moving;
  for (const MovingBall& ball : moving.balls) {
    const Stamp seen = ball.seen.value_or(moving.stamp);
    const double unseen_s = moving.stamp.seconds() - seen.seconds();
    if (unseen_s > view.setup.settings.out_of_view_s) continue;
    const double after_s = view.step.now.seconds() - seen.seconds() + after_now_s;
    const double reach_m =
        ball.radius_m + view.setup.settings.obstacle_speed_mps * std::max(0.0, after_s);
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      const double apart_m = (spheres.centre_m(s) - ball.centre_m).norm() - spheres.radius_m(s);
      if (spheres.moves(s) && apart_m < reach_m) return true;
    }
  }
  return false;
}

}  // namespace

double clearance_at_start_m(const PolicyView& view, const Trajectory& motion, double from_s) {
  Spheres spheres(view);
  spheres.place(motion, from_s);
  spheres.ask();
  double least_m = kInfinity;
  for (std::size_t s = 0; s < spheres.size(); ++s) {
    if (spheres.moves(s)) least_m = std::min(least_m, spheres.clearance_m(s));
  }
  return least_m;
}

double time_before_s(const PolicyView& view, const Trajectory& motion, double to_s, double way_m) {
  Spheres spheres(view);
  spheres.place(motion, to_s);
  const std::vector<Eigen::Vector3d> end_m(spheres.centres_m().begin(), spheres.centres_m().end());
  for (double time_s = to_s - kInstant_s; time_s > 0.0; time_s -= kInstant_s) {
    spheres.place(motion, time_s);
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      if ((spheres.centre_m(s) - end_m[s]).norm() >= way_m) return time_s;
    }
  }
  return 0.0;
}

std::string touches(const PolicyView& view, const Trajectory& motion, double from_s, double to_s) {
  const double margin_m = view.setup.settings.margin_m;
  const bool is_whole =
      !view.memory.has_left && clearance_at_start_m(view, motion, from_s) >= margin_m - kRounding_m;
  Spheres spheres(view);
  std::vector<double> least_m(spheres.size());
  for (const double time_s : instants(from_s, to_s)) {
    spheres.place(motion, time_s);
    spheres.ask();
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      const double clearance_m = spheres.clearance_m(s);
      if (time_s == from_s) {
        least_m[s] = is_whole ? margin_m - kRounding_m : std::min(0.0, clearance_m) - kLeaving_m;
      }
      if (!spheres.moves(s) || clearance_m >= least_m[s]) continue;
      return spheres.link(s) +
             format(" is %.4f m from the map after %.2f s", clearance_m, time_s - from_s);
    }
  }
  return {};
}

std::string touches_until_rest(const PolicyView& view, const Trajectory& motion, double now_s) {
  if (now_s >= motion.duration_s())
    return touches(view, motion, motion.duration_s(), motion.duration_s());
  const double brake_s = std::min(now_s + view.setup.settings.stop_lead_s, motion.duration_s());
  const Trajectory lead = cut(motion, now_s, std::max(brake_s, now_s + 1e-3));
  const auto stop = brake(motion, brake_s, view.setup.limits);
  // Where its path ends or turns before that, it stops beside it: what is clear then is not known.
  if (!stop) return {};
  const Trajectory way = joined(lead, *stop);
  return touches(view, way, 0.0, way.duration_s());
}

std::string is_reached(const PolicyView& view, const Trajectory& motion, double from_s) {
  const ReplannerSettings& settings = view.setup.settings;
  // When a stop may begin that the robot holds ready: soon, or after what it has just set out by.
  const double soon_s = settings.stop_lead_s + settings.search_s();
  const std::array brakes_s = {
      settings.stop_lead_s, soon_s + 0.02,
      soon_s + 0.03,        soon_s + 0.04,
      soon_s + 0.05,        settings.takeover_s + settings.replan_period_s + settings.search_s()};
  for (const double brake_s : brakes_s) {
    const double at_s = std::min(from_s + brake_s, motion.duration_s());
    const Trajectory lead = cut(motion, from_s, std::max(at_s, from_s + 1e-3));
    auto stop = brake(motion, at_s, view.setup.limits);
    if (!stop) stop = brake_straight(end_state(lead), view.setup.limits);
    if (!stop) continue;
    const Trajectory way = joined(lead, *stop);
    Spheres spheres(view);
    const auto is_met = [&](double time_s) {
      spheres.place(way, time_s);
      return reaches(view, spheres, time_s);
    };
    if (std::ranges::none_of(instants(0.0, way.duration_s()), is_met)) return {};
  }
  return "something that moves could reach the robot on every stop that it has";
}

std::string meets_predicted(const PolicyView& view, const Sent& sent) {
  const Prediction& prediction = *view.step.prediction;
  const double margin_m = view.setup.settings.prediction_margin_m;
  const double from_s = sent.start.seconds() - prediction.stamp().seconds();
  const double end_s = std::min(sent.trajectory.duration_s(), prediction.end_s() - from_s);
  if (end_s <= sent.takeover_s) return {};
  Spheres spheres(view);
  std::vector<double> distances_m(spheres.size());
  for (const double time_s : instants(sent.takeover_s, end_s)) {
    spheres.place(sent.trajectory, time_s);
    prediction.query(from_s + time_s, spheres.centres_m(), distances_m, {});
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      const double apart_m = distances_m[s] - spheres.radius_m(s);
      if (!spheres.moves(s) || apart_m >= margin_m - kRounding_m) continue;
      return spheres.link(s) +
             format(" is %.4f m from a predicted set after %.2f s", apart_m, time_s);
    }
  }
  return {};
}

std::string leaves_seen_space(const PolicyView& view, const Trajectory& motion) {
  const LoopSetup& setup = view.setup;
  const auto is_on_floor = [&](const std::string& link) {
    return std::ranges::count(setup.space.floor->except_links, link) > 0;
  };
  Spheres spheres(view);
  Eigen::Vector2d start_m = Eigen::Vector2d::Zero();
  Trajectory first = make_trajectory(motion.dof, 2, 1.0);
  for (const int state : {0, 1}) std::ranges::copy(*view.memory.q_first, first.q(state).begin());
  spheres.place(first, 0.0);
  double on_floor = 0.0;
  for (std::size_t s = 0; s < spheres.size(); ++s) {
    if (is_on_floor(spheres.link(s))) {
      start_m += (spheres.centre_m(s).head<2>() - start_m) / ++on_floor;
    }
  }
  // A voxel counts by its centre.
  const double beside_m = view.step.map.field->info().grid.resolution_m;
  double rest_s = 0.0;
  for (std::size_t j = 0; j < setup.limits.velocity.size(); ++j) {
    const double braking = setup.limits.while_stopping()[j];
    if (braking > 0.0) rest_s = std::max(rest_s, setup.limits.velocity[j] / braking);
  }
  const double until_s = std::min(setup.settings.stop_reserve * rest_s, motion.duration_s());
  for (const double time_s : instants(0.0, until_s)) {
    spheres.place(motion, time_s);
    spheres.ask();
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      if (!is_on_floor(spheres.link(s)) || spheres.status(s) == FieldStatus::kKnown) continue;
      const double off_m = (spheres.centre_m(s).head<2>() - start_m).norm();
      if (off_m <= *setup.settings.unseen_start_m + beside_m) continue;
      return spheres.link(s) + format(" is in unseen space after %.2f s", time_s);
    }
  }
  return {};
}

std::string leaves_joint_limits(const PolicyView& view, const Trajectory& motion, double until_s) {
  const std::vector<Joint>& joints = view.setup.robot->description().joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].type == Joint::Type::kContinuous) continue;
    const double lower = std::min(joints[j].lower, motion.q(0)[j]) - kLimitTolerance;
    const double upper = std::max(joints[j].upper, motion.q(0)[j]) + kLimitTolerance;
    for (int i = 0; i < motion.size() && motion.times_s[idx(i)] <= until_s; ++i) {
      const double q = motion.q(i)[j];
      if (q < lower || q > upper) return joints[j].name + format(" goes to %.6g", q);
    }
  }
  return {};
}

std::string is_too_fast(const PolicyView& view, const Sent& sent) {
  const MotionLimits& limits = view.setup.limits;
  if (limits.rolling) return {};  // whose limits are not those of the axes
  const Trajectory& motion = sent.trajectory;
  std::vector<double> q(idx(motion.dof)), qdot(idx(motion.dof));
  motion.sample(sent.takeover_s, q, qdot);
  for (int i = 0; i < motion.size(); ++i) {
    if (motion.times_s[idx(i)] < sent.takeover_s) continue;
    for (std::size_t j = 0; j < qdot.size(); ++j) {
      const double most = kLimitShare * std::max(limits.velocity[j], std::abs(qdot[j]));
      const double speed = std::abs(motion.qdot(i)[j]);
      if (speed > most) return limits.joint_name(j) + format(" moves at %.4g of %.4g", speed, most);
    }
  }
  return {};
}

std::string speeds_up_too_much(const PolicyView& view, const Sent& sent) {
  const MotionLimits& limits = view.setup.limits;
  if (limits.rolling) return {};
  const std::vector<double>& most = sent.is_stop ? limits.while_stopping() : limits.acceleration;
  const Trajectory& motion = sent.trajectory;
  constexpr double kNegligible = 1e-4;      // of a change of speed: the splice's
  constexpr double kAmongPredicted = 1.05;  // retime_among()
  const bool is_among = !sent.is_stop && view.step.prediction != nullptr;
  const double share = is_among ? kAmongPredicted : kLimitShare;
  for (int i = 0; i + 1 < motion.size(); ++i) {
    const double from_s = motion.times_s[idx(i)];
    if (from_s < sent.takeover_s - 1e-9) continue;
    const double took_s = motion.times_s[idx(i) + 1] - from_s;
    for (std::size_t j = 0; j < most.size(); ++j) {
      const double gained = std::abs(motion.qdot(i + 1)[j] - motion.qdot(i)[j]);
      if (gained <= share * most[j] * took_s + kNegligible) continue;
      return limits.joint_name(j) +
             format(" changes its speed by %.4g per s, not %.4g, after %.2f s", gained / took_s,
                    most[j], from_s);
    }
  }
  return {};
}

}  // namespace sidestep::detail
