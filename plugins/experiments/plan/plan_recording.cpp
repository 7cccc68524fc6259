#include "plan_recording.hpp"

#include <algorithm>
#include <cmath>

#include <sidestep/planning/costs.hpp>

#include "slices.hpp"

namespace sidestep {
namespace {

constexpr int kMotionSamples = 401;

std::string of_item(std::string_view series, std::int64_t item) {
  return std::string(series) + "/" + std::to_string(item);
}

void record_verdict(std::string_view check, const std::optional<Verdict>& verdict,
                    std::int64_t item, Recorder& recorder) {
  if (!verdict) return;
  const std::string prefix(check);
  recorder.add("plan", item, prefix + ".valid", verdict->valid());
  recorder.add("plan", item, prefix + ".min_clearance_m", verdict->min_clearance_m);
  recorder.add("plan", item, prefix + ".clearance_is_bound", verdict->clearance_is_bound);
  recorder.add("plan", item, prefix + ".min_clearance_link", verdict->min_clearance_link);
  recorder.add("plan", item, prefix + ".min_clearance_time_s", verdict->min_clearance_time_s);
  recorder.add("plan", item, prefix + ".min_self_clearance_m", verdict->min_self_clearance_m);
  recorder.add("plan", item, prefix + ".unknown_share", verdict->unknown_share);
  for (std::size_t v = 0; v < verdict->violations.size(); ++v) {
    recorder.add("plan", item, prefix + ".violation." + std::to_string(v),
                 verdict->violations[v].describe());
  }
}

void record_outcome(const PlanRecord& plan, std::int64_t item, Recorder& recorder) {
  recorder.add("plan", item, "name", plan.name);
  recorder.add("plan", item, "success", plan.success());
  recorder.add("plan", item, "reason", plan.reason);
  recorder.add("plan", item, "attempts", plan.attempts);
  recorder.add("plan", item, "status", to_string(plan.solution.status));
  recorder.add("plan", item, "solve_ms", plan.solution.solve_ms);
  recorder.add("plan", item, "iterations", plan.solution.iterations);
  if (plan.retiming) {
    recorder.add("plan", item, "before_retiming_s", plan.retiming->before_s);
    recorder.add("plan", item, "retiming_deviation", plan.retiming->deviation);
    recorder.add("plan", item, "retime_ms", plan.retiming->retime_ms);
  }
  recorder.add("plan", item, "initial_cost", plan.solution.initial_cost);
  recorder.add("plan", item, "cost", plan.solution.cost);
  for (const TermCost& term : plan.solution.terms) {
    recorder.add("plan", item, "cost." + term.name, term.cost);
  }
  if (plan.solution.explanation) {
    const auto& hindrances = plan.solution.explanation->hindrances;
    for (std::size_t h = 0; h < hindrances.size(); ++h) {
      recorder.add("plan", item, "hindrance." + std::to_string(h), hindrances[h].describe());
    }
  }
  record_verdict("snapshot", plan.in_snapshot, item, recorder);
  record_verdict("voxels", plan.in_voxels, item, recorder);
  record_verdict("scene", plan.in_scene, item, recorder);
}

void record_trajectory(const PlanRecord& plan, std::int64_t item, const RobotDescription& robot,
                       Recorder& recorder) {
  const Trajectory& trajectory = plan.solution.trajectory;
  const std::string series = of_item("trajectory", item);
  for (int i = 0; i < trajectory.size(); ++i) {
    recorder.add(series, i, "time_s", trajectory.times_s[static_cast<std::size_t>(i)]);
    for (std::size_t j = 0; j < robot.joints.size(); ++j) {
      recorder.add(series, i, "q." + robot.joints[j].name, trajectory.q(i)[j]);
      recorder.add(series, i, "qdot." + robot.joints[j].name, trajectory.qdot(i)[j]);
    }
  }
}

/// Joints and clearance over time, one array column each: time, clearance, q..., qdot....
void record_motion(const PlanRecord& plan, std::int64_t item, const PlanSurroundings& around,
                   Recorder& recorder) {
  const Trajectory& trajectory = plan.solution.trajectory;
  const RobotDescription& robot = around.robot.description();
  const auto dof = static_cast<std::size_t>(robot.dof());
  std::vector<double> q(dof), qdot(dof), distances(robot.spheres.size());
  std::vector<Eigen::Vector3d> centres(robot.spheres.size());
  std::vector<FieldStatus> statuses(robot.spheres.size());
  StoredArray motion{kMotionSamples, static_cast<int>(2 + 2 * dof), {}};
  const FloorClearance above_floor(around.space, robot);
  Scratch scratch;
  for (int i = 0; i < kMotionSamples; ++i) {
    const double time_s = trajectory.duration_s() * i / (kMotionSamples - 1);
    trajectory.sample(time_s, q, qdot);
    around.robot.sphere_centres(q, centres, scratch);
    query_with_policy(around.field, around.space, centres, distances, {}, statuses);
    double clearance_m = std::numeric_limits<double>::infinity();
    for (std::size_t s = 0; s < centres.size(); ++s) {
      clearance_m = std::min(
          {clearance_m, distances[s] - robot.spheres[s].radius_m, above_floor(s, centres[s])});
    }
    motion.values.push_back(static_cast<float>(time_s));
    motion.values.push_back(static_cast<float>(clearance_m));
    for (const double value : q) motion.values.push_back(static_cast<float>(value));
    for (const double value : qdot) motion.values.push_back(static_cast<float>(value));
  }
  const std::string series = of_item("motion", item);
  recorder.add(series, 0, "motion", motion);
  recorder.add(series, 0, "speed_fraction", around.speed_fraction);
  recorder.add(series, 0, "margin_m", around.margin_m);
}

void record_slices(const PlanRecord& plan, std::int64_t item, const PlanSurroundings& around,
                   Recorder& recorder) {
  const std::string series = of_item("slice", item);
  std::int64_t index = 0;
  for (const FieldSlice& slice : cut_slices(plan, around)) {
    recorder.add(series, index, "title", slice.title);
    recorder.add(series, index, "u_label", slice.u_label);
    recorder.add(series, index, "v_label", slice.v_label);
    recorder.add(series, index, "u0_m", slice.u0_m);
    recorder.add(series, index, "v0_m", slice.v0_m);
    recorder.add(series, index, "step_m", slice.step_m);
    recorder.add(series, index, "distance_m", slice.distance_m);
    recorder.add(series, index, "state", slice.state);
    recorder.add(series, index, "circles", slice.circles);
    recorder.add(series, index, "base_path", slice.base_path);
    recorder.add(series, index, "tip_path", slice.tip_path);
    ++index;
  }
}

}  // namespace

void record_frame(const MappingStep& step, std::int64_t item, Recorder& recorder) {
  recorder.add("frame", item, "sequence", step.frame_sequence);
  recorder.add("frame", item, "stamp_s", step.stamp.seconds());
  recorder.add("frame", item, "read_ms", step.read_ms);
  recorder.add("frame", item, "integrate_ms", step.integrate_ms);
  recorder.add("frame", item, "field_ms", step.field_ms);
  recorder.add("frame", item, "publish_ms", step.publish_ms);
  recorder.add("frame", item, "frame_ms", step.frame_ms());
  recorder.add("frame", item, "changed_blocks", step.update.changed_blocks.size());
  const IntegrationCounts& counts = step.update.counts;
  recorder.add("frame", item, "points", counts.points);
  recorder.add("frame", item, "inserted", counts.inserted);
  recorder.add("frame", item, "floor", counts.floor);
  recorder.add("frame", item, "self", counts.self);
  recorder.add("frame", item, "out_of_range", counts.out_of_range);
  recorder.add("frame", item, "outside_grid", counts.outside_grid);
  recorder.add("frame", item, "invalid", counts.invalid);
}

void record_depth_pictures(std::span<const DepthPicture> pictures, Recorder& recorder) {
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const DepthPicture& picture = pictures[i];
    const auto item = static_cast<std::int64_t>(i);
    recorder.add("depth", item, "sequence", picture.frame_sequence);
    recorder.add("depth", item, "depth_m",
                 StoredArray{picture.rows, picture.columns, picture.depth_m});
  }
}

void record_joints(const RobotDescription& robot, Recorder& recorder) {
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const Joint& joint = robot.joints[j];
    const auto item = static_cast<std::int64_t>(j);
    recorder.add("joint", item, "name", joint.name);
    recorder.add("joint", item, "unit", std::string_view(joint.unit()));
    recorder.add("joint", item, "lower", joint.lower);
    recorder.add("joint", item, "upper", joint.upper);
    recorder.add("joint", item, "max_velocity", joint.max_velocity);
  }
}

void record_plan(const PlanRecord& plan, std::int64_t item, const PlanSurroundings& around,
                 Recorder& recorder) {
  record_outcome(plan, item, recorder);
  if (plan.has_trajectory()) {
    record_trajectory(plan, item, around.robot.description(), recorder);
    record_motion(plan, item, around, recorder);
  }
  record_slices(plan, item, around, recorder);
}

}  // namespace sidestep
