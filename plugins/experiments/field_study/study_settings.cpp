#include "study_parts.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/blocks.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/entry_reading.hpp>
#include <sidestep/runtime/unused_keys.hpp>

namespace sidestep {
namespace {

/// `over` laid on the map `under`, key by key.
Node laid_over(Node under, const Node& over) {
  if (!under.is_map()) return over;
  for (const Node::Entry& entry : over.entries()) {
    if (Node* value = under.find(entry.key)) {
      *value = entry.value;
    } else {
      under.entries().push_back(entry);
    }
  }
  return under;
}

GridSpec grid_of(const StudyRobotEntry& entry, double resolution_m) {
  const Eigen::Array3d voxels = (entry.extent_m.array() / resolution_m - 1e-6).ceil();
  return {entry.origin_m, resolution_m, voxels.max(1.0).min(1e5).cast<int>().matrix()};
}

void check_regions(const StudyRobotEntry& entry, const Node& node, std::vector<Error>& errors) {
  const auto require = [&](bool holds, const char* key, const char* what) {
    if (holds) return;
    const Node* value = node.find(key);
    errors.push_back((value != nullptr ? *value : node).error(what));
  };
  require((entry.box_lower_m.array() <= entry.box_upper_m.array()).all(), "box_upper_m",
          "'box_upper_m' must not be below 'box_lower_m'");
  require((entry.side_lower_m.array() >= 0.0).all(), "side_lower_m",
          "'side_lower_m' must not be below 0");
  require((entry.side_lower_m.array() <= entry.side_upper_m.array()).all(), "side_upper_m",
          "'side_upper_m' must not be below 'side_lower_m'");
  require((entry.extent_m.array() > 0.0).all(), "extent_m",
          "'extent_m' must be above 0 along each axis");
  require(!entry.duration_s || entry.support_states, "duration_s",
          "'duration_s' needs 'support_states', too");
}

void refuse_floor(const Node& planning, std::vector<Error>& errors) {
  const Node* floor = planning.find("floor");
  if (floor == nullptr || floor->is_null()) return;
  errors.push_back(floor->error("the scenes of a field study have no floor"));
}

/// The `planning` block of one robot; mistakes that the override brings in are told here.
PlanningSettings read_planning(const Node& common, const Node& own, std::vector<Error>& errors) {
  const UsedSchema used = used_schema("field_study", PlanningSettings::parameters().schema(),
                                      unused_of_study_planning());
  const Node merged = own.is_map() ? laid_over(common, own) : common;
  std::vector<Error> before, found;
  check_against_used(common, used, before);
  check_against_used(merged, used, found);
  std::set<std::string> told;
  for (const Error& error : before) told.insert(error.describe());
  for (Error& error : found) {
    if (!told.contains(error.describe())) errors.push_back(std::move(error));
  }
  refuse_floor(own, errors);
  PlanningSettings settings;
  std::vector<Error> unreadable;  // no more than what the schema has told
  PlanningSettings::parameters().read(merged, settings, unreadable);
  return settings;
}

void check_field_block(const Configuration& configuration, Host& host, std::vector<Error>& errors) {
  const Node& block = block_of(configuration, "field");
  const auto plugin = host.find(PluginKind::kField, block);
  if (!plugin) return;  // told already
  if (const Node* sign = block.find("signed")) {
    errors.push_back(sign->error("'signed' is set by the study, which compares both",
                                 "leave it out of the `field` block"));
  }
  if (!has_parameter(plugin->schema, "signed")) {
    errors.push_back(block.error("the field '" + plugin->name + "' has no parameter 'signed'",
                                 "the study needs a field of both kinds, e.g. edt"));
  }
  for (const std::string& view : plugin->views) {
    if (view == OccupancyView::kViewName) continue;
    errors.push_back(block.error("the field '" + plugin->name + "' needs the view '" + view +
                                     "', and the study's scenes offer occupancy alone",
                                 "take a field that is made from occupancy, e.g. edt"));
  }
}

/// What is wrong with one robot and needs the robot to be known.
void check_robot(const StudyRobot& robot, const Node& field, Host& host,
                 std::vector<Error>& errors) {
  std::vector<Error> told;
  host.check(PluginKind::kRobot, robot.entry.robot, told);
  if (!told.empty()) return;
  const auto model = host.create<RobotModel>(robot.entry.robot);
  if (!model) {
    errors.push_back(model.error());
    return;
  }
  const RobotDescription& description = (*model)->description();
  (void)read_state_ranges(robot.entry, description, errors);
  const Node* limit = field.find("max_distance_m");
  const double limit_m = limit != nullptr ? limit->as_double().value_or(0.0) : 0.0;
  double radius_m = 0.0;
  for (const CollisionSphere& sphere : description.spheres) {
    radius_m = std::max(radius_m, sphere.radius_m);
  }
  const double reach_m = robot.planning.epsilon_m + radius_m;
  if (limit_m > 0.0 && limit_m < reach_m) {
    errors.push_back(limit->error("obstacle costs of '" + robot.entry.name + "' look " +
                                      detail::number_text(reach_m) +
                                      " m far, beyond 'max_distance_m'",
                                  "0 for no limit"));
  }
}

}  // namespace

std::vector<std::string> unused_of_study_planning() {
  return {"max_unknown_share", "retime", "time_limit_s", "attempts", "epsilon_moving_m"};
}

std::vector<JointRange> read_state_ranges(const StudyRobotEntry& entry,
                                          const RobotDescription& robot,
                                          std::vector<Error>& errors) {
  std::vector<JointRange> ranges;
  for (const Joint& joint : robot.joints) ranges.push_back({joint.lower, joint.upper});
  for (const Node::Entry& item : entry.state_ranges.entries()) {
    const auto joint = robot.joint_index(item.key);
    if (!joint) {
      errors.push_back(unknown_name("robot '" + robot.name + "' has no joint", item.key,
                                    item.key_mark.to_string(), names_of(robot.joints)));
      continue;
    }
    JointRange& range = ranges[static_cast<std::size_t>(*joint)];
    const auto bounds = item.value.as_doubles(2);
    if (!bounds) {
      errors.push_back(bounds.error());
      range = {0.0, 0.0};
    } else if (!((*bounds)[0] <= (*bounds)[1]) || (*bounds)[0] < range.lower ||
               (*bounds)[1] > range.upper) {
      errors.push_back(item.value.error(
          "the range of joint '" + item.key + "' must be ascending and within its limits [" +
          detail::number_text(range.lower) + ", " + detail::number_text(range.upper) + "]"));
    } else {
      range = {(*bounds)[0], (*bounds)[1]};
    }
  }
  for (std::size_t j = 0; j < ranges.size(); ++j) {
    if (std::isfinite(ranges[j].lower) && std::isfinite(ranges[j].upper)) continue;
    errors.push_back(entry.robot.error("joint '" + robot.joints[j].name + "' has no limits",
                                       "give it a range in `state_ranges`"));
  }
  return ranges;
}

FieldStudy read_field_study(const Configuration& configuration, std::vector<Error>& errors) {
  FieldStudy study;
  const Node& experiment = block_of(configuration, "experiment");
  const Node& check = block_of(configuration, "check");  // may be left out
  if (!read_entry(experiment, study.settings, errors)) return study;
  if (!check.is_null() && !read_entry(check, study.check, errors)) return study;
  if (study.check.wants_certificate()) {
    errors.push_back(
        check.find("certificate")
            ->error(
                "'certificate' is for plans among shapes, and without effect among random fields",
                "leave it out"));
  }
  refuse_floor(block_of(configuration, "planning"), errors);
  const Node& list = *experiment.find("robots");
  if (list.items().empty()) errors.push_back(list.error("there is no robot to study"));
  std::set<std::string> names;
  for (std::size_t r = 0; r < study.settings.robots.size(); ++r) {
    const StudyRobotEntry& entry = study.settings.robots[r];
    const Node& node = list.items()[r];
    take_name(*node.find("name"), "a robot", names, errors);
    check_regions(entry, node, errors);
    const double resolution_m = entry.resolution_m.value_or(study.settings.resolution_m);
    study.robots.push_back(
        {entry, read_planning(block_of(configuration, "planning"), entry.planning, errors),
         grid_of(entry, resolution_m)});
  }
  return study;
}

void check_field_study(const Configuration& configuration, Host& host, std::vector<Error>& errors) {
  const FieldStudy study = read_field_study(configuration, errors);
  check_field_block(configuration, host, errors);
  for (const StudyRobot& robot : study.robots) {
    if (!robot.entry.robot.is_map()) continue;
    check_robot(robot, block_of(configuration, "field"), host, errors);
  }
}

Parameters<PublishedOutcome> PublishedOutcome::parameters() {
  using P = PublishedOutcome;
  return Parameters<P>()
      .add("failure_percent", &P::failure_percent, "Failure rate, as printed.",
           {.unit = "%", .required = true})
      .add("iterations_mean", &P::iterations_mean, "Mean number of iterations.", {.required = true})
      .add("iterations_sd", &P::iterations_sd, "Its standard deviation.", {.required = true})
      .add("cost_mean", &P::cost_mean, "Mean cost of valid trajectories.", {.required = true})
      .add("cost_sd", &P::cost_sd, "Its standard deviation.", {.required = true});
}

Parameters<PublishedComparison> PublishedComparison::parameters() {
  using P = PublishedComparison;
  return Parameters<P>()
      .add("unsigned", &P::unsigned_field, "With the unsigned field.", {.required = true})
      .add("signed", &P::signed_field, "With the signed field.", {.required = true});
}

Parameters<StudyRobotEntry> StudyRobotEntry::parameters() {
  using E = StudyRobotEntry;
  return Parameters<E>()
      .add("name", &E::name, "Name of the robot in results.", {.required = true})
      .add("robot", &E::robot, "A robot's plugin and parameters.",
           {.required = true, .plugin = PluginKind::kRobot})
      .add("planning", &E::planning,
           "Values of the `planning` block that this robot has of its own.")
      .add("state_ranges", &E::state_ranges,
           "Ranges that states are drawn from, {JOINT: [lower, upper]}; else the joint's limits.")
      .add("box_lower_m", &E::box_lower_m, "Lower corner of the region of boxes' centres.",
           {.unit = "m"})
      .add("box_upper_m", &E::box_upper_m, "Upper corner of the region of boxes' centres.",
           {.unit = "m"})
      .add("side_lower_m", &E::side_lower_m, "Least sides of boxes.", {.unit = "m"})
      .add("side_upper_m", &E::side_upper_m, "Largest sides of boxes.", {.unit = "m"})
      .add("origin_m", &E::origin_m, "Lower corner of the fields.", {.unit = "m"})
      .add("extent_m", &E::extent_m, "Edges of the fields.", {.unit = "m"})
      .add("resolution_m", &E::resolution_m, "Edge of a voxel, where it is not that of the study.",
           {.unit = "m", .min = 1e-3, .max = 1.0})
      .add("support_states", &E::support_states,
           "Support states of every trajectory; left out: as `planning` says.",
           {.min = 3, .max = 10000})
      .add("duration_s", &E::duration_s,
           "Duration of every trajectory, with support_states; left out: dt_s between them.",
           {.unit = "s", .min = 1e-3, .max = 1e4})
      .add("published", &E::published, "What somebody printed, to stand beside ours.");
}

Parameters<FieldStudySettings> FieldStudySettings::parameters() {
  using S = FieldStudySettings;
  return experiment_parameters<S>()
      .add("robots", &S::robots, "The robots to study, in this order.", {.required = true})
      .add("states", &S::states, "States of each robot; every pair of them is a motion.",
           {.min = 2, .max = 1000})
      .add("scenes", &S::scenes, "Scenes for each robot.", {.min = 1, .max = 100000})
      .add("boxes_per_scene", &S::boxes_per_scene, "Boxes in each scene.", {.min = 0, .max = 10000})
      .add("resolution_m", &S::resolution_m, "Edge of a voxel of the fields.",
           {.unit = "m", .min = 1e-3, .max = 1.0})
      .add("start_or_goal_in_collision", &S::start_or_goal_in_collision,
           "Problems whose start or goal collides, which none can solve: solve them like all "
           "others, or skip them.",
           {.choices = {"solve", "skip"}})
      .add("confidence", &S::confidence, "Of the confidence intervals.",
           {.min = 0.5, .max = 0.9999})
      .add("bootstrap_samples", &S::bootstrap_samples,
           "Draws of scenes that intervals of means and differences are taken from.",
           {.min = 100, .max = 1000000})
      .add("published_as", &S::published_as, "Head of the columns of published figures.");
}

}  // namespace sidestep
