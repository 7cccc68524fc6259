#include <sidestep/runtime/replanner.hpp>

namespace sidestep {

Parameters<ReplannerSettings> ReplannerSettings::parameters() {
  using S = ReplannerSettings;
  return Parameters<S>()
      .add("replan_period_s", &S::replan_period_s,
           "Least time from one replan's begin to the next one's.",
           {.unit = "s", .min = 1e-3, .max = 60.0})
      .add("takeover_s", &S::takeover_s, "From a replan's begin to when its trajectory takes over.",
           {.unit = "s", .min = 1e-3, .max = 60.0})
      .add("solve_limit_s", &S::solve_limit_s,
           "For all attempts of one replan; less than takeover_s. A robot at rest takes half of "
           "takeover_s, if that is more.",
           {.unit = "s", .min = 1e-4, .max = 60.0})
      .add(
          "horizon_s", &S::horizon_s,
          "Where no trajectory is free all the way, one that is so for this long may do, if it may "
          "be at the goal sooner than what is followed.",
          {.unit = "s", .min = 0.0, .max = 3600.0})
      .add(
          "stopgap_after_s", &S::stopgap_after_s,
          "By the wall's clock: after so long no further first guess is tried where one has led to "
          "a trajectory that is free for horizon_s.",
          {.unit = "s", .min = 0.0, .max = 60.0})
      .add("stop_lead_s", &S::stop_lead_s, "From the decision to stop to when braking begins.",
           {.unit = "s", .min = 0.0, .max = 60.0})
      .add("max_state_age_s", &S::max_state_age_s,
           "A measured state older than this leads to a stop.",
           {.unit = "s", .min = 1e-3, .max = 3600.0})
      .add("max_map_age_s", &S::max_map_age_s, "A map older than this leads to a stop.",
           {.unit = "s", .min = 1e-3, .max = 3600.0})
      .add("goal_tolerance", &S::goal_tolerance, "Of every joint at the goal (m, rad).",
           {.min = 1e-6, .max = 10.0})
      .add(
          "obstacle_speed_mps", &S::obstacle_speed_mps,
          "Largest speed of what moves: while the robot moves, it can come to rest before anything "
          "seen moving could reach it. 0: what moves is an obstacle like any other.",
          {.unit = "m/s", .min = 0.0, .max = 20.0})
      .add(
          "obstacle_acceleration_mps2", &S::obstacle_acceleration_mps2,
          "How fast what is tracked, standing or not, can change its velocity: within a short time "
          "it is near where it was going. Left out: it may turn at once.",
          {.unit = "m/s^2", .min = 0.0, .max = 100.0})
      .add("out_of_view_s", &S::out_of_view_s,
           "For so long what has been seen to move, and is in no image since, is feared from where "
           "it "
           "was seen last.",
           {.unit = "s", .min = 0.0, .max = 3.0})
      .add("safety", &S::safety,
           "passive: as obstacle_speed_mps has it; ssm: speed and separation monitoring (ISO/TS "
           "15066): whoever is tracked, standing or not, may walk up at 1.6 m/s (ISO 13855), and "
           "every link has come to rest intrusion_m before it could be reached.",
           {.choices = {"passive", "ssm"}})
      .add("intrusion_m", &S::intrusion_m,
           "Of ssm: how far somebody may reach beyond what is tracked, and what both positions may "
           "be off.",
           {.unit = "m", .min = 0.0, .max = 10.0})
      .add("rest_speed", &S::rest_speed, "Joints that are slower count as at rest (m/s, rad/s).",
           {.min = 1e-6, .max = 10.0})
      .add("tracking_tolerance", &S::tracking_tolerance,
           "Largest distance of a joint from what it follows (m, rad); beyond it the robot stops.",
           {.min = 1e-6, .max = 100.0})
      .add("margin_m", &S::margin_m, "Clearance that spheres must keep from obstacles.",
           {.unit = "m", .min = 0.0, .max = 10.0})
      .add(
          "unseen_start_m", &S::unseen_start_m,
          "How far from where the robot starts the links that stand on the floor may move in space "
          "that no frame has seen: what is known to be free there. Farther off, the centres of "
          "their spheres keep to what has been seen, as far as a stop takes. Left out: they may be "
          "anywhere.",
          {.unit = "m", .min = 0.0, .max = 100.0})
      .add("prediction_horizon_s", &S::prediction_horizon_s,
           "How far a `predictor` looks ahead of each map.", {.unit = "s", .min = 0.1, .max = 60.0})
      .add("timing", &S::timing,
           "fastest: motions are timed anew, each joint as fast as its limits allow; planner: as "
           "the optimiser timed them, where that keeps the limits (`space_time` keeps the speed of "
           "the base below that of one joint, in whatever direction it goes).",
           {.choices = {"fastest", "planner"}})
      .add("prediction_margin_m", &S::prediction_margin_m,
           "Clearance that spheres must keep from what is predicted.",
           {.unit = "m", .min = 0.0, .max = 10.0})
      .add("max_step_m", &S::max_step_m, "First spacing of validity checks, as sphere motion.",
           {.unit = "m", .min = 1e-4, .max = 1.0})
      .add("stop_reserve", &S::stop_reserve,
           "A stop begins no later than when what blocks the trajectory is so many times as far "
           "away, in time, as the robot needs to come to rest.",
           {.min = 1.0, .max = 100.0})
      .add(
          "cost_tolerance", &S::cost_tolerance,
          "A valid trajectory is replanned, too, once its cost in the newest map has grown by this "
          "share of what it was where it was planned; 0: never.",
          {.min = 0.0, .max = 1e9})
      .add("hysteresis", &S::hysteresis,
           "Share by which a new trajectory must then be cheaper to be taken.",
           {.min = 0.0, .max = 1.0})
      .add("escalation", &S::escalation,
           "First guesses of a replan, in order: retimed (which needs a `predictor`), refit, "
           "straight_line, base_path, perturbed, sampled (which needs a `sampler`), after_stop.");
}

}  // namespace sidestep
