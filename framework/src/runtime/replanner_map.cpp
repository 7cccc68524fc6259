#include <algorithm>
#include <cmath>
#include <utility>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/runtime/call_plugin.hpp>
#include <sidestep/runtime/predict.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "replanner_impl.hpp"

namespace sidestep {
namespace {

std::string seconds(double value) { return format("%.3g s", value); }

double largest(const Eigen::VectorXd& values) {
  return values.size() == 0 ? 0.0 : values.cwiseAbs().maxCoeff();
}

/// Passes on one message a second: a predictor at fault is so thirty times a second.
class RareMessages final : public Log {
 public:
  RareMessages(Log& to, Stamp now, std::optional<Stamp>& last) : to_(to), now_(now), last_(last) {}
  void write(LogLevel level, std::string_view message) override {
    if (last_ && now_ >= *last_ && now_.seconds() - last_->seconds() < 1.0) return;
    last_ = now_;
    to_.write(level, message);
  }

 private:
  Log& to_;
  Stamp now_;
  std::optional<Stamp>& last_;
};

}  // namespace

std::optional<RobotState> Replanner::Impl::measure() {
  auto current = call_stage(parts.executor_name, [&] { return parts.executor.current(); });
  if (!current) {
    halt(Reason::kExecutor, "the robot's state is not known: " + current.error().describe(), true);
    return std::nullopt;
  }
  if (is_overdue()) {
    halt(Reason::kExecutor,
         parts.executor_name + " took " + seconds(1e-3 * watch.elapsed_ms()) +
             " to tell where the robot is",
         true);
    return std::nullopt;
  }
  RobotState& state = current->state;
  if (state.qdot.size() == 0) state.qdot = Eigen::VectorXd::Zero(state.q.size());
  const Eigen::Index dof = parts.robot->description().dof();
  if (state.q.size() != dof || state.qdot.size() != dof || !state.q.allFinite() ||
      !state.qdot.allFinite()) {
    halt(Reason::kExecutor,
         parts.executor_name + " measured a state that is not of the robot or not finite", true);
    return std::nullopt;
  }
  const double age_s = now.seconds() - current->stamp.seconds();
  if (age_s > settings.max_state_age_s) {
    halt(Reason::kExecutor,
         "the newest state of " + parts.executor_name + " is " + seconds(age_s) + " old", true);
    return std::nullopt;
  }
  measured_at = current->stamp;
  return std::move(state);
}

bool Replanner::Impl::is_at_rest(const RobotState& measured) const {
  return largest(measured.qdot) < settings.rest_speed;
}

bool Replanner::Impl::reaches_goal(const RobotState& measured) const {
  const Eigen::VectorXd& goal = free_goal ? *free_goal : parts.goal.q;
  return is_at_rest(measured) && goal.size() == measured.q.size() &&
         largest(measured.q - goal) <= settings.goal_tolerance;
}

bool Replanner::Impl::keeps_to_plan(const RobotState& measured) {
  if (motion() == nullptr) return true;
  Eigen::VectorXd planned(measured.q.size());
  const auto dof = static_cast<std::size_t>(planned.size());
  motion()->trajectory.sample(motion()->time_s(measured_at), std::span(planned.data(), dof), {});
  Eigen::Index joint = 0;
  const double off = (planned - measured.q).cwiseAbs().maxCoeff(&joint);
  if (off <= settings.tracking_tolerance) return true;
  const Joint& worst = parts.robot->description().joints[static_cast<std::size_t>(joint)];
  halt(Reason::kNotFollowing,
       parts.executor_name + " is not following: joint '" + worst.name + "' is " +
           format("%.3g %s", off, worst.type == Joint::Type::kPrismatic ? "m" : "rad") +
           " from where it should be",
       true);
  return false;
}

/// Lets go of a motion that is over: a stop, or a plan that did not end at the goal.
void Replanner::Impl::end_motion(const RobotState& measured) {
  if (motion() == nullptr) return;
  const Trajectory& followed = motion()->trajectory;
  if (motion()->time_s(now) < followed.duration_s() || !is_at_rest(measured)) return;
  if (std::holds_alternative<Braking>(phase) && halted && halted->reason == Reason::kMoving) {
    tell(Event::Kind::kStopped, halted->reason, halted->cause);
  }
  phase = Resting{end_state(followed).q};
}

void Replanner::Impl::keep_to_observed(const RobotState& measured) {
  if (!settings.unseen_start_m || !parts.space.floor || parts.space.observed) return;
  const RobotDescription& robot = parts.robot->description();
  ObservedSpace observed{parts.space.floor->except_links, Eigen::Vector2d::Zero(),
                         *settings.unseen_start_m};
  Scratch scratch;
  std::vector<Eigen::Vector3d> centres(robot.spheres.size());
  parts.robot->sphere_centres({measured.q.data(), static_cast<std::size_t>(measured.q.size())},
                              centres, scratch);
  double spheres = 0.0;
  for (std::size_t s = 0; s < centres.size(); ++s) {
    const std::string& link = robot.links[static_cast<std::size_t>(robot.spheres[s].link)].name;
    if (std::ranges::find(observed.links, link) == observed.links.end()) continue;
    observed.start_m += (centres[s].head<2>() - observed.start_m) / ++spheres;
  }
  parts.space.observed = std::move(observed);
}

double Replanner::Impl::stopping_time_s() const {
  const std::vector<double>& braking = parts.limits.while_stopping();
  double stop_s = 0.0;
  for (std::size_t j = 0; j < parts.limits.velocity.size(); ++j) {
    if (braking[j] > 0.0) stop_s = std::max(stop_s, parts.limits.velocity[j] / braking[j]);
  }
  return 2.0 * settings.replan_period_s + settings.search_s() + settings.stop_lead_s +
         settings.stop_reserve * stop_s;
}

bool Replanner::Impl::look_at_map() {
  MapSnapshot map = parts.slot.snapshot();
  const auto& newest = map.field;
  auto& tracks = map.tracks;
  if (!newest) {
    const double waited_s = now.seconds() - first_step->seconds();
    if (waited_s > settings.max_map_age_s) {
      halt(Reason::kMap, with_map_trouble("there is no map yet"));
    }
    return false;
  }
  const double stamp_s = newest->info().stamp.seconds();
  const double last_s = field ? field->info().stamp.seconds() : stamp_s;
  const double age_s = now.seconds() - stamp_s;
  if (stamp_s < last_s) {
    halt(Reason::kMap,
         with_map_trouble("the map's time jumped back by " + seconds(last_s - stamp_s)));
    return false;
  }
  if (age_s > settings.max_map_age_s) {
    halt(Reason::kMap, with_map_trouble("the map is " + seconds(age_s) + " old, more than " +
                                        seconds(settings.max_map_age_s)));
    return false;
  }
  if (-age_s > settings.max_map_age_s) {
    halt(Reason::kMap, with_map_trouble("the map is " + seconds(-age_s) + " ahead of the clock"));
    return false;
  }
  if (newest == field) return true;
  std::shared_ptr<const Prediction> ahead;
  // What does not go by tracks needs none.
  const bool is_of_things =
      parts.predictor != nullptr && parts.predictor->subject() == PredictionSubject::kThings;
  if (tracks == nullptr && is_of_things) {
    tracks = std::make_shared<const Tracks>(Tracks{{}, newest->info().stamp});
  }
  if (parts.predictor != nullptr && tracks != nullptr) {
    auto predicted = look_ahead(*tracks, *newest);
    if (!predicted) {
      halt(Reason::kMap, with_map_trouble("what is tracked in the map makes no sense: " +
                                          predicted.error().describe()));
      return false;
    }
    ahead = std::make_shared<const Prediction>(*std::move(predicted));
  }
  field = newest;
  map_came = now;
  reach.look_at(map.moving.get(), tracks.get());
  prediction = std::move(ahead);
  if (auto* driving = std::get_if<Driving>(&phase)) {
    driving->is_unreached = driving->is_checked = false;
  }
  const double kept_m = margin_m;
  const auto leaving = std::exchange(parts.space.leaving, nullptr);
  use_margin(settings.margin_m);
  if ((kept_m == settings.margin_m && leaving == nullptr) || motion() == nullptr) return true;
  // What left an obstacle with less keeps the whole margin again as soon as it can.
  const auto verdict = full_check->check(motion()->trajectory, motion()->time_s(now), Deadline());
  if (verdict && verdict->valid()) return true;
  if (leaving != nullptr) parts.space.leaving = still_leaving(*leaving);
  use_margin(kept_m);
  return true;
}

Result<Prediction> Replanner::Impl::look_ahead(const Tracks& tracks, const DistanceField& map) {
  const RobotFootprint robot = footprint(*parts.robot, measured_state);
  RareMessages log(parts.log, now, told_of_predictor);
  return predict(*parts.predictor, parts.predictor_name,
                 {tracks, settings.prediction_horizon_s, &map, &robot}, log);
}

std::optional<PredictionOnClock> Replanner::Impl::predicted_from(Stamp begin) const {
  if (prediction == nullptr) return std::nullopt;
  return PredictionOnClock{prediction, begin.seconds() - prediction->stamp().seconds()};
}

std::string Replanner::Impl::with_map_trouble(const std::string& cause) const {
  const std::string trouble = parts.map_trouble ? parts.map_trouble() : "";
  return trouble.empty() ? cause : cause + ": " + trouble;
}

void Replanner::Impl::use_margin(double kept_m) {
  margin_m = kept_m;
  FieldCheckSettings settings_of_check = {.margin_m = kept_m,
                                          .max_step_m = settings.max_step_m,
                                          .first_violation_only = true,
                                          .observed_s = stopping_time_s()};
  full_check = checks_of_robot.make(field, parts.space, settings_of_check);
  settings_of_check.obstacles_only = true;
  obstacle_check = checks_of_robot.make(field, parts.space, settings_of_check);
}

void Replanner::Impl::use_margin_at(const Eigen::VectorXd& q) {
  parts.space.leaving.reset();
  const auto is_free = [&](double kept_m) {
    const auto violation = checks_of_robot.state_violation(field, parts.space, kept_m, as_span(q));
    return !violation || violation->kind != Violation::Kind::kCollision;
  };
  for (const double share : {1.0, 0.5, 0.25, 0.0}) {
    if (is_free(share * settings.margin_m)) return use_margin(share * settings.margin_m);
  }
  parts.space.leaving = leaving_from(q);
  if (!is_free(settings.margin_m)) parts.space.leaving.reset();  // it is in the floor, say
  use_margin(settings.margin_m);
}

/// By how much each sphere falls short of the margin where the robot stands; nothing where that is
/// more than noise, or somebody who stood beside it, accounts for.
std::shared_ptr<const Leaving> Replanner::Impl::leaving_from(const Eigen::VectorXd& q) const {
  constexpr double kDeepest_m = 0.1;
  constexpr double kTolerance_m = 1e-3;
  const std::vector<CollisionSphere>& spheres = parts.robot->description().spheres;
  Leaving leaving;
  leaving.centres_m.resize(spheres.size());
  Scratch scratch;
  parts.robot->sphere_centres(as_span(q), leaving.centres_m, scratch);
  std::vector<double> distances_m(spheres.size());
  std::vector<FieldStatus> statuses(spheres.size());
  query_with_policy(*field, parts.space, leaving.centres_m, distances_m, {}, statuses);
  const std::vector<bool> fixed = fixed_spheres(*parts.robot);
  for (std::size_t s = 0; s < spheres.size(); ++s) {
    const double depth_m = fixed[s] ? 0.0 : spheres[s].radius_m - distances_m[s];
    // Without a sign nobody knows how deep a centre is.
    const bool is_too_deep =
        depth_m > kDeepest_m || (distances_m[s] <= 0.0 && !fixed[s] && !field->info().is_signed);
    if (is_too_deep) return nullptr;
    const double short_m = fixed[s] ? 0.0 : depth_m + settings.margin_m;
    leaving.depths_m.push_back(short_m > 0.0 ? short_m + kTolerance_m : 0.0);
  }
  return std::make_shared<const Leaving>(std::move(leaving));
}

/// The same while it goes, of the spheres that are not out yet by the newest map; nothing once all
/// are.
std::shared_ptr<const Leaving> Replanner::Impl::still_leaving(const Leaving& leaving) const {
  Eigen::VectorXd q(motion()->trajectory.dof);
  motion()->trajectory.sample(motion()->time_s(now), {q.data(), idx(q.size())}, {});
  const auto here = leaving_from(q);
  if (here == nullptr) return nullptr;  // deeper than what may be left
  auto rest = std::make_shared<Leaving>(leaving);
  for (std::size_t s = 0; s < rest->depths_m.size(); ++s) {
    if (here->depths_m[s] == 0.0) rest->depths_m[s] = 0.0;
  }
  const bool is_out =
      std::ranges::none_of(rest->depths_m, [](double depth_m) { return depth_m > 0.0; });
  return is_out ? nullptr : rest;
}

void Replanner::Impl::check(Driving& driving) {
  const ValidityCheck& needed = driving.is_sound ? *obstacle_check : *full_check;
  const auto verdict = needed.check(driving.trajectory, driving.time_s(now), Deadline());
  ++checks;
  driving.is_checked = true;
  driving.blocked.reset();
  std::optional<PredictedConflict> conflict;
  if (const auto predicted = predicted_from(driving.start)) {
    conflict = prediction_check.first_conflict(driving.trajectory, driving.time_s(now), *predicted);
  }
  const bool is_clear = verdict && verdict->valid();
  if (is_clear) driving.is_sound = true;
  if (is_clear && !conflict) return;
  Blocked& blocked = driving.blocked.emplace(Blocked{});
  if (conflict && (is_clear || (verdict && conflict->time_s < verdict->first_violation_s))) {
    blocked.begin_s = conflict->time_s;
    blocked.cause = describe(*conflict, driving);
    return;
  }
  if (!verdict || verdict->violations.empty()) {
    blocked.cause = "what is followed cannot be checked";
    if (!verdict) blocked.cause += ": " + verdict.error().describe();
    return;
  }
  const Violation* first = &verdict->violations.front();
  for (const Violation& other : verdict->violations) {
    if (other.time_s < first->time_s) first = &other;
  }
  blocked.begin_s = std::max(driving.time_s(now), verdict->first_violation_s);
  blocked.cause = describe(first->kind == Violation::Kind::kUnproven
                               ? first_violation_after(*first, driving.trajectory)
                               : *first,
                           driving);
}

/// What is in the way soon after a place at which nothing but the proof failed; that, if nothing
/// is.
Violation Replanner::Impl::first_violation_after(const Violation& unproven,
                                                 const Trajectory& trajectory) const {
  constexpr int kSteps = 25;
  constexpr double kStep_s = 0.02;
  std::vector<double> q(static_cast<std::size_t>(trajectory.dof));
  for (int i = 0; i <= kSteps; ++i) {
    const double time_s = unproven.time_s + i * kStep_s;
    trajectory.sample(time_s, q, {});
    auto violation = checks_of_robot.state_violation(field, parts.space, margin_m, q);
    if (!violation) continue;
    violation->time_s = time_s;
    return *std::move(violation);
  }
  return unproven;
}

std::string Replanner::Impl::describe(const PredictedConflict& conflict,
                                      const Motion& motion) const {
  const double in_s = conflict.time_s - motion.time_s(now);
  return "track " + std::to_string(conflict.track) + " may meet " +
         parts.robot->description().links[static_cast<std::size_t>(conflict.link)].name +
         (in_s > 0.0 ? " in " + seconds(in_s) : " now");
}

/// What, where and how soon: the obstacle's place is that of the point nearest to the link.
std::string Replanner::Impl::describe(const Violation& violation, const Motion& motion) const {
  std::string text = violation.what();
  const RobotDescription& robot = parts.robot->description();
  const auto link = robot.link_index(violation.subject);
  if (violation.kind == Violation::Kind::kCollision && link) {
    std::vector<double> q(static_cast<std::size_t>(motion.trajectory.dof));
    motion.trajectory.sample(violation.time_s, q, {});
    Scratch scratch;
    std::vector<Eigen::Vector3d> centres(robot.spheres.size()), gradients(robot.spheres.size());
    std::vector<double> distances(robot.spheres.size());
    parts.robot->sphere_centres(q, centres, scratch);
    field->query(centres, distances, gradients, {});
    const FloorClearance above_floor(parts.space, robot);
    std::optional<std::size_t> nearest;
    for (std::size_t s = 0; s < robot.spheres.size(); ++s) {
      if (robot.spheres[s].link != *link) continue;
      const auto clearance = [&](std::size_t i) {
        return std::min(distances[i] - robot.spheres[i].radius_m, above_floor(i, centres[i]));
      };
      if (!nearest || clearance(s) < clearance(*nearest)) nearest = s;
    }
    if (nearest) {
      const std::size_t s = *nearest;
      const double floor_m = above_floor(s, centres[s]);
      Eigen::Vector3d place = centres[s] - distances[s] * gradients[s].normalized();
      if (floor_m <= distances[s] - robot.spheres[s].radius_m) {
        place = centres[s] - (floor_m + robot.spheres[s].radius_m) * Eigen::Vector3d::UnitZ();
      }
      text += format(" at (%.2f, %.2f, %.2f) m", place.x(), place.y(), place.z());
    }
  }
  const double in_s = violation.time_s - motion.time_s(now);
  return text + (in_s > 0.0 ? " in " + seconds(in_s) : " now");
}

}  // namespace sidestep
