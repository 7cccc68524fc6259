#include <set>

#include <sidestep/certificates/leave_certificate.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/measures/source_facts.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/summary.hpp>
#include <sidestep/runtime/attached_settings.hpp>
#include <sidestep/runtime/checked_robot.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/cost_plugins.hpp>
#include <sidestep/runtime/entry_reading.hpp>
#include <sidestep/runtime/results_store.hpp>
#include <sidestep/runtime/run_observer.hpp>
#include <sidestep/runtime/shape_check.hpp>
#include <sidestep/runtime/standing_floor.hpp>
#include <sidestep/trajectory/write_trajectory.hpp>
#include "plan_parts.hpp"

namespace sidestep {
namespace {

/// One entry of `experiment.plans`.
struct PlanEntry : TaskEntry {
  std::string name;
  RobotStateEntry start;
  std::optional<RobotStateEntry> goal;
  std::vector<AttachedEntry> attached;
  std::vector<PluginCostEntry> costs;

  static Parameters<PlanEntry> parameters() {
    auto parameters =
        Parameters<PlanEntry>()
            .add("name", &PlanEntry::name, "Name of the plan in results.", {.required = true})
            .add("start", &PlanEntry::start, "Where the robot starts.", {.required = true})
            .add("goal", &PlanEntry::goal,
                 "Where the robot is to be; with `end_effector`, where the search for that begins, "
                 "which is the start if it is left out.")
            .add("attached", &PlanEntry::attached,
                 "What the robot carries, fixed to its links: costs, checks and pictures have it.");
    return declare_task(std::move(parameters),
                        "Where a link is to be at the end, whatever the configuration.")
        .add("costs", &PlanEntry::costs, "Costs that plugins make.");
  }
};

/// The `experiment` block of a plan experiment.
struct PlanExperimentSettings : ExperimentSettings {
  std::int64_t max_frames = 0;
  int depth_pictures = 6;
  std::vector<double> slice_heights_m;
  std::string trajectories = "none";
  std::vector<PlanEntry> plans;

  static Parameters<PlanExperimentSettings> parameters() {
    using S = PlanExperimentSettings;
    return experiment_parameters<S>()
        .add("max_frames", &S::max_frames, "Frames to map; 0 for all that the source has.",
             {.min = 0})
        .add("depth_pictures", &S::depth_pictures, "Depth images to show in the report.",
             {.min = 0, .max = 24})
        .add("slice_heights_m", &S::slice_heights_m,
             "Heights at which the report cuts the field; empty: chosen from each plan.",
             {.unit = "m"})
        .add("trajectories", &S::trajectories,
             "Whether the trajectory of each plan that passes is written for other programs, into "
             "the run's folder `trajectories`: `csv`, with a column for each joint's position and "
             "velocity, or `json`, MoveIt's RobotTrajectory.",
             {.choices = {"none", "csv", "json"}})
        .add("plans", &S::plans, "The plans to make, in this order.", {.required = true});
  }
};

struct PlanSettings {
  PlanExperimentSettings experiment;
  PlanningSettings planning;
  CheckSettings check;
};

/// Start, goal and task of every plan, read from the configuration where mistakes have a position.
std::vector<PlanRecord> read_plans(const Configuration& configuration,
                                   const std::shared_ptr<const RobotModel>& robot, Host& host,
                                   std::vector<Error>& errors) {
  std::vector<PlanRecord> plans;
  const Node* list = block_of(configuration, "experiment").find("plans");
  if (list == nullptr) return plans;
  std::set<std::string> names;
  for (const Node& entry : list->items()) {
    PlanRecord plan;
    const Node* name = entry.find("name");
    const Node* start = entry.find("start");
    const Node* goal = entry.find("goal");
    if (goal != nullptr && goal->is_null()) goal = nullptr;
    const auto is_map = [](const Node* node) { return node != nullptr && node->is_map(); };
    if (name == nullptr || !is_map(start) || (goal != nullptr && !is_map(goal)))
      continue;  // its schema told
    plan.name = name->text();
    take_name(*name, "a plan", names, errors);
    plan.robot = read_attached(entry, robot, errors);
    const std::vector<Link>& links = plan.robot->description().links;
    for (std::size_t i = robot->description().links.size(); i < links.size(); ++i) {
      plan.attached.push_back(links[i].name);
    }
    plan.q_start = read_robot_state(*start, robot->description(), errors);
    plan.q_goal =
        goal != nullptr ? read_robot_state(*goal, robot->description(), errors) : plan.q_start;
    const std::size_t before = errors.size();
    plan.task = read_task(entry, plan.robot, errors);
    read_plugin_costs(entry, plan.robot, host, plan.task, errors);
    if (goal == nullptr && !plan.task.frees_goal && errors.size() == before) {
      errors.push_back(entry.error("plan '" + plan.name + "' says nowhere where the robot is to be",
                                   "give it a `goal` or an `end_effector`"));
    }
    plans.push_back(std::move(plan));
  }
  if (list->is_list() && list->items().empty())
    errors.push_back(list->error("there is nothing to plan"));
  return plans;
}

/// The robot with the links that any plan attaches: names that `check` may use.
RobotDescription robot_of_all(const RobotModel& robot, std::span<const PlanRecord> plans) {
  RobotDescription all = robot.description();
  for (const PlanRecord& plan : plans) {
    for (const std::string& name : plan.attached) all.links.push_back({name, 0});
  }
  return all;
}

/// The parts of the run that plugins provide.
struct Parts : Planners {
  std::shared_ptr<const RobotModel> robot;
  PluginPtr<Source> source;
  PluginPtr<Mapper> mapper;
  PluginPtr<FieldBuilder> field_builder;
  const OccupancyView* occupancy = nullptr;  ///< Of the mapper.
  std::shared_ptr<const Scene> scene;        ///< Behind the source's frames; null where not known.
};

Result<Parts> make_parts(ExperimentContext& context) {
  const Configuration& configuration = context.configuration;
  Parts parts;
  parts.robot = SIDESTEP_TRY(context.host.create<RobotModel>(block_of(configuration, "robot")));
  const auto make = [&]<class Plugin>(std::string_view block,
                                      PluginPtr<Plugin>& into) -> Result<void> {
    into = SIDESTEP_TRY(context.host.create<Plugin>(block_of(configuration, block), parts.robot));
    return {};
  };
  SIDESTEP_TRY(make("source", parts.source));
  SIDESTEP_TRY(make("mapper", parts.mapper));
  SIDESTEP_TRY(make("field", parts.field_builder));
  SIDESTEP_TRY(make("optimiser", parts.optimiser));
  if (!block_of(configuration, "sampler").is_null()) {
    SIDESTEP_TRY(make("sampler", parts.sampler));
  }
  parts.occupancy = dynamic_cast<const OccupancyView*>(parts.mapper.get());
  if (parts.occupancy == nullptr) {
    return fail(ErrorCode::kUnsupported,
                "the independent check needs a mapper that offers its occupied voxels",
                block_of(configuration, "mapper").mark().to_string());
  }
  parts.scene = SIDESTEP_TRY(true_scene(parts.source));
  return parts;
}

void tell_assumed_accelerations(const RobotDescription& robot, const PlanningSettings& planning,
                                Log& log) {
  const auto names = joints_of_unknown_acceleration(robot);
  if (names.empty()) return;
  log.info("the acceleration limits of '" + joined(names, "', '") +
           "' are not known; taken for each: its velocity limit reached in " +
           format("%g s", planning.assumed_ramp_s));
}

/// Shows a plan to an observer from a time on, which it moves to the plan's end.
void show_plan(RunObserver& observer, const PlanRecord& plan, Stamp& time) {
  if (!plan.has_trajectory()) return;
  auto trajectory = std::make_shared<const Trajectory>(plan.solution.trajectory);
  ObservedEvent shown;
  shown.event.stamp = shown.event.takeover = time;
  shown.event.solve_ms = plan.solution.solve_ms;
  shown.event.cost = plan.solution.cost;
  shown.event.cause = plan.name;
  if (plan.success()) {
    shown.followed = trajectory;
    shown.followed_start = time;
  } else {
    shown.event.kind = ReplannerEvent::Kind::kReplanFailed;
    shown.event.cause += ": " + plan.reason;
    shown.event.refused = trajectory;
  }
  observer.happened(shown);
  time.ns += Stamp::from_seconds(trajectory->duration_s()).ns;
}

/// Of a robot, what was mapped, and what the plans of a run share. The scene is checked as it is
/// when a plan starts.
Result<PlanningContext> make_planning_context(std::shared_ptr<const RobotModel> robot,
                                              const MapRecord& map, const Parts& parts,
                                              const PlanSettings& settings) {
  const OccupancyView& occupancy = *parts.occupancy;
  const CheckSettings& check = settings.check;
  PlanningContext context{std::move(robot), map.field, occupancy, settings.planning, check};
  stand_on_floor(context.planning, *context.robot);
  context.field_check =
      make_field_check(context.robot, context.field, context.planning.space(), check.of_field());
  ShapeCheckSettings shapes = check.of_shapes();
  ShapeObstacles voxels;
  voxels.resolution_m = occupancy.occupancy_grid().resolution_m;
  voxels.occupied_centres_m = occupied_centres(occupancy);
  if (context.planning.floor) voxels.floor = *context.planning.floor;
  context.obstacles = voxels;
  context.voxel_check = SIDESTEP_TRY(make_shape_check(context.robot, std::move(voxels), shapes));
  if (!parts.scene) return context;
  context.obstacles.scene = parts.scene;
  ShapeObstacles truth;
  truth.scene = parts.scene;
  truth.scene_time_s = map.steps.back().stamp.seconds();
  for (const AllowedContactEntry& contact : check.allowed_contacts) {
    const bool is_here = context.robot->description().link_index(contact.link).has_value();
    if (is_here) shapes.allowed_contacts.push_back(contact);  // else attached in another plan
  }
  context.allowed = shapes.allowed_contacts;
  context.scene_check = SIDESTEP_TRY(make_shape_check(context.robot, std::move(truth), shapes));
  return context;
}

/// Plans through a finished map, recording each plan as soon as it is there in `plans`.
Result<void> make_plans(Parts& parts, const MapRecord& map, std::vector<PlanRecord> requests,
                        const PlanSettings& settings, Recorder& recorder,
                        ExperimentContext& context, std::vector<PlanRecord>& plans,
                        Stamp& shown_until) {
  // One for all plans that the robot makes as it is; one for each plan that has it carry something.
  std::unique_ptr<const PlanningContext> shared;
  tell_assumed_accelerations(parts.robot->description(), settings.planning, context.log);
  const auto total = std::ssize(requests);
  for (PlanRecord& request : requests) {
    const auto index = std::ssize(plans);
    if (context.stop.stop_requested()) break;
    if (context.progress) context.progress(index, total, "planning " + request.name);
    if (!shared || shared->robot != request.robot) {
      shared = std::make_unique<const PlanningContext>(
          SIDESTEP_TRY(make_planning_context(request.robot, map, parts, settings)));
    }
    PlanRecord made = std::move(request);
    SIDESTEP_TRY(make_plan(*shared, parts, context.seed, context.log, context.stop, made));
    if (settings.check.wants_certificate() && made.success()) {
      made.certified = name_of(SIDESTEP_TRY(leave_certificate(
          *shared->robot, shared->obstacles, shared->allowed, made.solution.trajectory,
          context.out / file_of("certificates", made.name, "json"))));
    }
    if (const std::string& format = settings.experiment.trajectories;
        format != "none" && made.success()) {
      SIDESTEP_TRY(write_trajectory(made.solution.trajectory,
                                    names_of(made.robot->description().joints),
                                    context.out / file_of("trajectories", made.name, format)));
    }
    record_plan(made, index, *shared, settings.experiment.slice_heights_m, recorder);
    if (context.observer != nullptr) show_plan(*context.observer, made, shown_until);
    plans.push_back(std::move(made));
    SIDESTEP_TRY(recorder.commit());
  }
  if (context.progress) context.progress(total, total, "planning");
  return {};
}

class PlanExperiment final : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override {
    return {.blocks = {"robot", "source", "mapper", "field", "optimiser", "planning"},
            .optional_blocks = {"check", "sampler"},
            .unused_of_planning = {"epsilon_moving_m"}};
  }
  [[nodiscard]] const report::RunReport& report() const override { return plan_report(); }
  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    host.check_views(block_of(configuration, "mapper"), {OccupancyView::kViewName},
                     "the independent check of plans", errors);
    const auto robot = checked_robot(configuration, host, errors);
    if (robot == nullptr) return;
    const auto plans = read_plans(configuration, robot, host, errors);
    const RobotDescription all = robot_of_all(*robot, plans);
    check_allowed_contacts(block_of(configuration, "check"), all, nullptr, errors);
    check_floor(block_of(configuration, "planning"), all, errors);
  }
  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    const PlanSettings settings{
        SIDESTEP_TRY(read_block<PlanExperimentSettings>(context.configuration, "experiment")),
        SIDESTEP_TRY(read_block<PlanningSettings>(context.configuration, "planning")),
        SIDESTEP_TRY(read_block<CheckSettings>(context.configuration, "check"))};
    auto parts = SIDESTEP_TRY(make_parts(context));
    std::vector<Error> errors;
    auto requests = read_plans(context.configuration, parts.robot, context.host, errors);
    check_allowed_contacts(block_of(context.configuration, "check"),
                           robot_of_all(*parts.robot, requests), parts.scene.get(), errors);
    if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));

    const RunProvenance provenance = provenance_of(context);
    auto store = SIDESTEP_TRY(ResultsStore::open(context.out / "results.sqlite", provenance));
    Recorder recorder(*store);
    stored_joint().record_all(parts.robot->description().joints, "joint", recorder);

    const auto frames = SIDESTEP_TRY(frame_count_of(parts.source));
    FrameTap source(*parts.source, frames, settings.experiment.max_frames,
                    settings.experiment.depth_pictures);
    source.keep_last(context.observer != nullptr);
    const Node& mapper_block = block_of(context.configuration, "mapper");
    source.survey(*parts.mapper, PointSurvey::of_mapper(context.host.with_defaults(
                                     PluginKind::kMapper, mapper_block)));
    if (context.observer != nullptr && !requests.empty()) {
      context.observer->begin({context.configuration.name, 0, parts.robot, parts.scene,
                               requests.front().q_start, requests.front().q_goal});
    }
    SnapshotSlot slot;
    MappingPipeline pipeline(
        {source,
         *parts.mapper,
         *parts.field_builder,
         slot,
         context.log,
         {plugin_of(parts.source), plugin_of(parts.mapper), plugin_of(parts.field_builder)}});
    auto map =
        SIDESTEP_TRY(map_frames(pipeline, source, *parts.occupancy, slot, recorder, context));

    // Plans are shown back to back, from the last frame on.
    Stamp shown_until = map.steps.empty() ? Stamp{} : map.steps.back().stamp;
    std::vector<PlanRecord> plans;
    if (!map.steps.empty() && map.empty_reason.empty() && !map.interrupted && !map.fault) {
      // Held here, so that what was measured before a robot throws is kept.
      auto done = catch_all("planning", [&] {
        return make_plans(parts, map, std::move(requests), settings, recorder, context, plans,
                          shown_until);
      });
      if (!done) map.fault = std::move(done.error());
      map.interrupted = context.stop.stop_requested();
    }
    auto outcome = summarise_plans(provenance, map, plans);
    if (context.observer != nullptr) {
      context.observer->end({shown_until, outcome.success, outcome.verdict});
    }
    return outcome;
  }
  [[nodiscard]] Result<ExperimentOutcome> merge(const std::vector<std::filesystem::path>&,
                                                const std::filesystem::path& out) const override {
    return fail(ErrorCode::kUnsupported,
                "its plans share one map, which each part would have to make anew", out.string());
  }
};

}  // namespace
}  // namespace sidestep

SIDESTEP_EXPERIMENT(sidestep::PlanExperiment, sidestep::PlanExperimentSettings, "plan", "0.1.0",
                    "A map from a source, and one or more plans through it")
