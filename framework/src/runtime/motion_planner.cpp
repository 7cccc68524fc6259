#include <sidestep/runtime/motion_planner.hpp>

#include <algorithm>

#include <sidestep/core/index.hpp>
#include <sidestep/field/scene_field.hpp>
#include <sidestep/runtime/shape_check.hpp>

namespace sidestep {
namespace {

/// Clearance that smooth motions keep beyond what is asked for, so that the independent check can
/// show them clear, too: its steps near obstacles are up to 0.5 mm long and its distances err by
/// 1e-5 m. Sampling planners keep such a distance themselves.
constexpr double kSpareMargin_m = 3e-4;

}  // namespace

void check_planner(const Node& block, std::vector<Error>& errors) {
  const Node* seeds = block.find("seeds");
  const auto is_given = [&](const char* name) {
    const Node* plugin = block.find(name);
    return plugin != nullptr && plugin->is_map();
  };
  if (seeds == nullptr && !is_given("optimiser")) {
    errors.push_back(block.error("the seed 'straight' needs a block `optimiser`"));
  }
  if (seeds == nullptr || !seeds->is_list()) return;
  if (seeds->items().empty()) errors.push_back(seeds->error("there is no seed to begin with"));
  for (const Node& seed : seeds->items()) {
    const bool is_sampled = seed.text() == "sampled";
    if (!is_sampled && seed.text() != "straight") {
      errors.push_back(
          seed.error("no seed is called '" + seed.text() + "'", "there are straight and sampled"));
    } else if (!is_given(is_sampled ? "sampler" : "optimiser")) {
      errors.push_back(seed.error("the seed '" + seed.text() + "' needs a block " +
                                  (is_sampled ? "`sampler`" : "`optimiser`")));
    }
  }
}

std::string checker_of(const PlannerSettings& settings) {
  const bool is_sampling = std::ranges::count(settings.seeds, "sampled") > 0;
  const Node* checker = is_sampling ? settings.sampler.find("checker") : nullptr;
  return checker != nullptr ? checker->text() : "field";
}

MotionPlanner::MotionPlanner(std::shared_ptr<const RobotModel> robot,
                             std::vector<PlanningRace::Lane> lanes, PlanningSettings planning,
                             CheckSettings check, bool by_shapes)
    : robot_(std::move(robot)),
      planning_(std::move(planning)),
      check_(std::move(check)),
      by_shapes_(by_shapes),
      checks_(robot_),
      race_(std::move(lanes), planning_.limits(robot_->description())) {}

Result<MotionPlanner> MotionPlanner::create(Host& host,
                                            const std::shared_ptr<const RobotModel>& robot,
                                            const PlannerSettings& settings,
                                            PlanningSettings planning, CheckSettings check,
                                            std::uint64_t seed) {
  const RunLoan loan{robot, nullptr, nullptr, seed};
  std::vector<PlanningRace::Lane> lanes;
  for (const std::string& guess : settings.seeds) {
    PlanningRace::Lane lane{guess, nullptr, nullptr};
    if (!settings.optimiser.is_null()) {
      lane.optimiser = SIDESTEP_TRY(host.create<Optimiser>(settings.optimiser, loan));
    }
    if (guess == "sampled") {
      lane.sampler = SIDESTEP_TRY(host.create<Optimiser>(settings.sampler, loan));
    }
    lanes.push_back(std::move(lane));
  }
  // Paths by FCL that nothing polishes: no check by spheres is to come after them.
  const bool by_shapes = settings.optimiser.is_null() && checker_of(settings) == "primitives";
  return MotionPlanner(robot, std::move(lanes), std::move(planning), std::move(check), by_shapes);
}

Problem MotionPlanner::pose(const MotionQuery& query) const {
  Problem problem = make_problem(robot_, query.field, planning_, query.q_start, query.q_goal);
  problem.terms.insert(problem.terms.end(), query.terms.begin(), query.terms.end());
  return problem;
}

Result<RaceResult> MotionPlanner::plan(const MotionQuery& query, const Deadline& deadline,
                                       const std::stop_token& stop) {
  const Problem problem = pose(query);
  if (auto sound = problem.validate(); !sound) {
    return RaceResult{.reason = "the problem makes no sense: " + sound.error().describe()};
  }
  const auto* exact = dynamic_cast<const SceneField*>(query.field.get());
  if (by_shapes_ && exact != nullptr) {
    ShapeObstacles shapes;
    shapes.scene = exact->scene();
    const auto check = SIDESTEP_TRY(make_shape_check(robot_, shapes, check_.of_shapes()));
    return race_.run(problem, {*check, *check}, query.seed, deadline, stop);
  }
  FieldCheckSettings settings = check_.of_field();
  settings.first_violation_only = true;
  const auto sampled = checks_.make(query.field, planning_.space(), settings);
  settings.margin_m += kSpareMargin_m;
  const auto smooth = checks_.make(query.field, planning_.space(), settings);
  RaceResult result =
      SIDESTEP_TRY(race_.run(problem, {*sampled, *smooth}, query.seed, deadline, stop));
  if (result.trajectory.size() > 0) return result;
  for (const auto& [end, q] : {std::pair("start", &query.q_start), {"goal", &query.q_goal}}) {
    const auto violation = checks_.state_violation(query.field, planning_.space(),
                                                   check_.of_field().margin_m, as_span(*q));
    if (!violation) continue;
    result.reason = std::string("the ") + end + " is not valid: " + violation->what();
    break;
  }
  return result;
}

}  // namespace sidestep
