// Problems, planners, checks and proofs.
#include <mutex>

#include <sidestep/certificates/leave_certificate.hpp>
#include <sidestep/certificates/polynomial_motion.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/state_cost.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/problems/problem_set.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/motion_planner.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/shape_check.hpp>
#include <sidestep/runtime/standing_floor.hpp>
#include <sidestep/runtime/step_watch.hpp>

#include "bindings.hpp"

namespace sidestep::python {
namespace {

using FieldPtr = std::shared_ptr<DistanceField>;

/// A cost that a Python class says: a subclass of sidestep.Cost.
class PythonCost final : public StateCost {
 public:
  explicit PythonCost(py::object self)
      : self_(std::move(self)),
        name_(py::str(self_.get().attr("name"))),
        residuals_(self_.get().attr("residual_count").cast<int>()),
        depends_on_velocity_(self_.get().attr("depends_on_velocity").cast<bool>()) {
    if (residuals_ < 1) throw py::value_error("residual_count has to be 1 or more");
  }

  [[nodiscard]] std::string_view name() const noexcept override { return name_; }
  [[nodiscard]] int residual_count() const noexcept override { return residuals_; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return depends_on_velocity_; }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    const Locked lock;
    const py::ssize_t n = states.count, d = states.dof;
    const auto copied = [](std::span<const double> values, std::vector<py::ssize_t> shape) {
      return py::array_t<double>(std::move(shape), values.data());
    };
    const py::object result = called(self_.get(), "evaluate", copied(states.q, {n, d}),
                                     copied(states.qdot, {n, d}), copied(states.times_s, {n}));
    if (!py::isinstance<py::tuple>(result)) throw py::type_error("it does not return a tuple");
    const auto items = py::reinterpret_borrow<py::tuple>(result);
    write(items, 0, "residuals", {n, residuals_}, out.residuals);
    write(items, 1, "derivatives by q", {n, residuals_, d}, out.jacobian_q);
    if (depends_on_velocity_) {
      write(items, 2, "derivatives by qdot", {n, residuals_, d}, out.jacobian_qdot);
    } else {
      std::ranges::fill(out.jacobian_qdot, 0.0);
    }
  }

 private:
  /// One of the arrays that Python returned; where `into` is empty, nobody wants it.
  static void write(const py::tuple& items, std::size_t item, const char* what,
                    const std::vector<py::ssize_t>& shape, std::span<double> into) {
    if (into.empty()) return;
    if (item >= items.size()) throw py::value_error(std::string("it returns no ") + what);
    const Doubles array = doubles_of(items[item], what);
    const std::vector<py::ssize_t> got(array.shape(), array.shape() + array.ndim());
    if (got != shape) {
      throw py::value_error(std::string(what) + " have to be " + shape_text(shape) + ", and are " +
                            shape_text(got));
    }
    std::copy_n(array.data(), into.size(), into.data());
  }

  Held self_;
  std::string name_;
  int residuals_;
  bool depends_on_velocity_;
};

/// An optimiser that a Python class is: a subclass of sidestep.Optimiser.
class PythonOptimiser final : public Optimiser {
 public:
  static constexpr const char* kClass = "Optimiser";

  explicit PythonOptimiser(py::object self) : self_(std::move(self)) {}

  Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                         const Deadline& deadline) override {
    const Locked lock;
    const Stopwatch watch;
    const py::object found = called(self_.get(), "solve", problem, initial, deadline.remaining_s());
    Solution solution;
    solution.solve_ms = watch.elapsed_ms();
    if (py::isinstance<Trajectory>(found)) {
      solution.status = SolveStatus::kConverged;
      solution.trajectory = found.cast<Trajectory>();
      if (solution.trajectory.dof != initial.dof) {
        throw py::value_error("it returns a trajectory of " +
                              std::to_string(solution.trajectory.dof) + " joints");
      }
    } else if (found.is_none()) {
      solution.status = SolveStatus::kNoPath;
      solution.reason = "it found none";
    } else {
      throw py::type_error("solve() has to return a Trajectory or None");
    }
    return solution;
  }

 private:
  Held self_;
};

}  // namespace

PluginPtr<Optimiser> make_optimiser(const SessionPtr& session, const RobotPtr& robot,
                                    const py::object& value, const char* key) {
  return part_of<Optimiser, PythonOptimiser>(session, robot, value, key, "optimiser", "solve");
}

PlanningSettings planning_of(const py::object& value, const RobotModel& robot) {
  py::dict block;
  if (py::isinstance<py::dict>(value)) {
    block.attr("update")(value);
  } else if (!value.is_none()) {
    throw py::type_error("planning has to be a dict");
  }
  block.attr("setdefault")("unknown", "occupied");
  block.attr("setdefault")("outside", block["unknown"]);
  auto settings = settings_of<PlanningSettings>(block, "planning");
  stand_on_floor(settings, robot);
  return settings;
}

namespace {

constexpr const char* kAsked =
    "a planner cannot be asked by a cost or an optimiser while it is planning";

constexpr double kGrace_s = 1.0;  ///< With callbacks, beyond the deadline.

/// Tells of callbacks that are not back a while after the deadline.
std::unique_ptr<StepWatch> watch_of_calls(double deadline_s) {
  constexpr double kLongest_s = 1e6;  // who is waited for that long is not watched
  if (!(deadline_s < kLongest_s)) return nullptr;
  const double longest_s = std::max(deadline_s, 0.0) + kGrace_s;
  auto watch = std::make_unique<StepWatch>(longest_s, [] {
    (void)catch_all("warning", []() -> Result<void> {
      warn_of_open_calls("planning is past its deadline, and still");
      return {};
    });
  });
  watch->begin();
  return watch;
}

/// A planner and what it was made by.
struct Planner {
  Planner(SessionPtr its, RobotPtr moved, MotionPlanner plans, bool asks)
      : session(std::move(its)),
        robot(std::move(moved)),
        planner(std::move(plans)),
        asks_python(asks) {}

  SessionPtr session;
  RobotPtr robot;
  MotionPlanner planner;
  bool asks_python;  ///< For its optimiser or sampler.
  Alone alone = {};

  RaceResult plan(const FieldPtr& field, const py::object& start, const py::object& goal,
                  double deadline_s, std::uint64_t seed, const std::vector<py::object>& costs) {
    MotionQuery query = query_of(field, start, goal, costs);
    query.seed = seed;
    return unlocked("planning", [&]() -> Result<RaceResult> {
      const auto lock = SIDESTEP_TRY(alone.enter(kAsked));
      const auto watch = asks_python || !costs.empty() ? watch_of_calls(deadline_s) : nullptr;
      return planner.plan(query, Deadline::after_s(deadline_s));
    });
  }
  Problem pose(const FieldPtr& field, const py::object& start, const py::object& goal,
               const std::vector<py::object>& costs) {
    const MotionQuery query = query_of(field, start, goal, costs);
    return unlocked("planning", [&]() -> Result<Problem> {
      const auto lock = SIDESTEP_TRY(alone.enter(kAsked));
      Problem problem = planner.pose(query);
      SIDESTEP_TRY(problem.validate());
      return problem;
    });
  }
  MotionQuery query_of(const FieldPtr& field, const py::object& start, const py::object& goal,
                       const std::vector<py::object>& costs) const {
    const RobotDescription& about = robot->description();
    MotionQuery query{field, configuration_of(start, about, "start"),
                      configuration_of(goal, about, "goal")};
    for (const py::object& cost : costs) {
      need_object(cost, "Cost", {"evaluate", "name", "residual_count", "depends_on_velocity"});
      query.terms.push_back({guard_cost(made_of<StateCost, PythonCost>(cost, "cost")),
                             Placement::kSupportAndInterpolated});
    }
    return query;
  }
};

std::shared_ptr<Planner> make_planner(const SessionPtr& session, const RobotPtr& robot,
                                      const py::object& optimiser, const py::object& sampler,
                                      const std::optional<std::vector<std::string>>& seeds,
                                      const py::object& planning, const py::object& check) {
  std::vector<std::string> guesses = seeds.value_or(std::vector<std::string>());
  if (!seeds && !optimiser.is_none()) guesses.emplace_back("straight");
  if (!seeds && !sampler.is_none()) guesses.emplace_back("sampled");
  if (guesses.empty()) throw py::value_error("a planner needs an optimiser, a sampler or both");
  std::vector<PlanningRace::Lane> lanes;
  for (const std::string& guess : guesses) {
    const bool is_sampled = guess == "sampled";
    if (!is_sampled && guess != "straight") {
      throw py::value_error("no seed is called '" + guess + "': there are straight and sampled");
    }
    if ((is_sampled ? sampler : optimiser).is_none()) {
      throw py::value_error("the seed '" + guess + "' needs " +
                            (is_sampled ? "a sampler" : "an optimiser"));
    }
    lanes.push_back({guess, make_optimiser(session, robot, optimiser, "optimiser"),
                     is_sampled ? make_optimiser(session, robot, sampler, "sampler") : nullptr});
  }
  return std::make_shared<Planner>(
      session, robot,
      MotionPlanner(robot, std::move(lanes), planning_of(planning, *robot),
                    settings_of<CheckSettings>(check, "check")),
      py::hasattr(optimiser, "solve") || py::hasattr(sampler, "solve"));
}

/// A check and what it needs to live.
struct Check {
  std::shared_ptr<const ValidityCheck> check;
};

Check field_check(const RobotPtr& robot, const FieldPtr& field, const py::object& planning,
                  const py::object& check) {
  const SpacePolicy space = planning_of(planning, *robot).space();
  const auto settings = settings_of<CheckSettings>(check, "check").of_field();
  const Unlocked release;
  return {make_field_check(robot, field, space, settings)};
}

/// What a robot's shapes are held against: a scene, or the occupied voxels of a field.
struct World {
  std::shared_ptr<const Scene> scene;
  std::shared_ptr<const DistanceField> field;
  Space unknown = Space::kOccupied;

  World(const py::object& world, const std::string& unknown_is) {
    if (py::isinstance<Scene>(world)) {
      scene = world.cast<std::shared_ptr<Scene>>();
    } else if (py::isinstance<DistanceField>(world)) {
      field = world.cast<std::shared_ptr<DistanceField>>();
      (void)dense(*field);
    } else {
      throw py::type_error("world has to be a Scene or a DistanceField");
    }
    if (unknown_is != "free" && unknown_is != "occupied") {
      throw py::value_error("unknown has to be \"free\" or \"occupied\"");
    }
    if (unknown_is == "free") unknown = Space::kFree;
  }
  [[nodiscard]] ShapeObstacles obstacles() const {
    ShapeObstacles obstacles;
    obstacles.scene = scene;
    if (!field) return obstacles;
    obstacles.resolution_m = field->info().grid.resolution_m;
    obstacles.occupied_centres_m = occupied_centres(*field, unknown);
    return obstacles;
  }
};

Check shape_check(const RobotPtr& robot, const py::object& in, const std::string& unknown,
                  const py::object& check) {
  const World world(in, unknown);
  const auto settings = settings_of<CheckSettings>(check, "check");
  ShapeCheckSettings of_shapes = settings.of_shapes();
  for (const AllowedContactEntry& contact : settings.allowed_contacts) {
    of_shapes.allowed_contacts.push_back(contact);
  }
  return {unlocked("check", [&]() -> Result<std::shared_ptr<const ValidityCheck>> {
    return std::shared_ptr<const ValidityCheck>(
        SIDESTEP_TRY(make_shape_check(robot, world.obstacles(), of_shapes)));
  })};
}

Certification prove(const RobotPtr& robot, const py::object& in, const Trajectory& trajectory,
                    double margin_m, const std::string& unknown) {
  const World world(in, unknown);
  const auto* tree = dynamic_cast<const KinematicTree*>(robot.get());
  if (tree == nullptr) {
    raise({ErrorCode::kUnsupported,
           "robot '" + robot->description().name +
               "' does not tell its joints, and nothing can be proven of it",
           {},
           {},
           nullptr});
  }
  need(trajectory.validate());
  return unlocked("certify", [&] {
    return certify(*tree, certified_scene(world.obstacles()), polynomials_of(trajectory),
                   {.margin_m = margin_m, .wants_certificate = true});
  });
}

}  // namespace

void bind_planning(py::module_& module, py::class_<Session, SessionPtr>& session) {
  py::class_<Problem>(module, "Problem", "What an optimiser is given.")
      .def_property_readonly(
          "start", [](const Problem& p) { return p.start.q; }, "dof values, m or rad.")
      .def_property_readonly(
          "goal", [](const Problem& p) { return p.goal.q; }, "dof values, m or rad.")
      .def_property_readonly(
          "field", [](const Problem& p) { return std::const_pointer_cast<DistanceField>(p.field); },
          "The map to plan in.")
      .def_property_readonly(
          "robot", [](const Problem& p) { return std::const_pointer_cast<RobotModel>(p.robot); },
          "Whose motion is planned.")
      .def_readonly("support_states", &Problem::support_states,
                    "How many states a motion has, start and goal included.")
      .def_readonly("dt_s", &Problem::dt_s, "Between two support states, in s.")
      .def_readonly("collision_margin_m", &Problem::collision_margin_m,
                    "Least distance in m between the robot's spheres and obstacles.")
      .def(
          "cost",
          [](const Problem& problem, const Trajectory& trajectory) {
            return unlocked("cost", [&] { return explain(problem, trajectory); }).cost;
          },
          py::arg("trajectory"),
          "Of a trajectory with `support_states` states: the prior's and all terms'.");

  py::class_<RaceResult>(module, "Plan", "A planner's answer; true where there is one.")
      .def_property_readonly(
          "trajectory",
          [](const RaceResult& plan) -> std::optional<Trajectory> {
            if (plan.trajectory.size() == 0) return std::nullopt;
            return plan.trajectory;
          },
          "Timed, and valid by the planner's check; None where there is none.")
      .def_readonly("reason", &RaceResult::reason, "Why there is none.")
      .def_readonly("seed", &RaceResult::seed, "The first guess that led there.")
      .def_readonly("is_smooth", &RaceResult::is_smooth, "It does not stop at corners.")
      .def_readonly("took_ms", &RaceResult::took_ms, "Until there was this answer, in ms.")
      .def_property_readonly(
          "first_ms",
          [](const RaceResult& plan) {
            return plan.earlier.empty() ? plan.took_ms : plan.earlier.front().took_ms;
          },
          "Until there was any valid answer, in ms.")
      .def_property_readonly(
          "earlier",
          [](const RaceResult& plan) {
            std::vector<Trajectory> found;
            for (const EarlierAnswer& answer : plan.earlier) found.push_back(answer.trajectory);
            return found;
          },
          "Valid trajectories that were found before a better one, in order.")
      .def_readonly("spent_ms", &RaceResult::spent_ms, "Until the planner ended, in ms.")
      .def("__bool__", [](const RaceResult& plan) { return plan.trajectory.size() > 0; });

  py::class_<Planner, std::shared_ptr<Planner>>(
      module, "Planner", "Plans a robot's motions and answers only with what passes its check.")
      .def("plan", &Planner::plan, py::arg("field").none(false), py::arg("start"), py::arg("goal"),
           py::arg("deadline_s") = 5.0, py::arg("seed") = 0,
           py::arg("costs") = std::vector<py::object>(),
           "start, goal: a pose's name, {\"pose\": ..., \"joints\": {...}} or dof values. costs: "
           "objects of classes derived from sidestep.Cost.")
      .def("problem", &Planner::pose, py::arg("field").none(false), py::arg("start"),
           py::arg("goal"), py::arg("costs") = std::vector<py::object>(),
           "The Problem that plan() would give to the planner's optimiser.");

  py::class_<Verdict>(module, "Verdict", "What a check says; true where a motion is valid.")
      .def("__bool__", &Verdict::valid)
      .def("__str__", &Verdict::describe)
      .def_property_readonly(
          "outcome", [](const Verdict& v) { return std::string(to_string(v.outcome)); },
          "\"valid\", \"invalid\", or \"unproven\": no violation found, nor shown that there is "
          "none.")
      .def_readonly("min_clearance_m", &Verdict::min_clearance_m,
                    "Least distance to obstacles and floor at the times checked, in m; as far as "
                    "was looked where nothing is nearer, inf where there is nothing.")
      .def_readonly("min_clearance_link", &Verdict::min_clearance_link,
                    "The link that is so near; \"\" where there is nothing.")
      .def_readonly("min_clearance_time_s", &Verdict::min_clearance_time_s,
                    "When it is, in s of the trajectory.")
      .def_readonly("min_self_clearance_m", &Verdict::min_self_clearance_m,
                    "Least distance between parts of the robot at the times checked, in m.")
      .def_property_readonly(
          "violations",
          [](const Verdict& v) {
            std::vector<std::string> said;
            for (const Violation& violation : v.violations) said.push_back(violation.describe());
            return said;
          },
          "The worst of each link or joint and kind, worst first, a sentence each.");
  py::class_<Check>(module, "Check", "Decides whether a motion is safe, over continuous time.")
      .def(
          "check",
          [](const Check& self, const Trajectory& trajectory, double from_s) {
            return unlocked("check",
                            [&] { return self.check->check(trajectory, from_s, Deadline()); });
          },
          py::arg("trajectory"), py::arg("from_s") = 0.0,
          "The Verdict on a trajectory, from a time of it in s on.");

  py::class_<Certification>(module, "Certification",
                            "A proof, or its refutation; true where proven.")
      .def("__bool__",
           [](const Certification& c) { return c.outcome == Certification::Outcome::kProven; })
      .def_property_readonly(
          "outcome", [](const Certification& c) { return std::string(name_of(c.outcome)); },
          "\"proven\", \"refuted\" or \"undecided\".")
      .def_property_readonly(
          "witness",
          [](const Certification& c) -> py::object {
            if (!c.witness) return py::none();
            py::dict witness;
            witness["time_s"] = c.witness->time_s;
            witness["a"] = c.witness->a;
            witness["b"] = c.witness->b;
            witness["distance_m"] = c.witness->distance_m;
            return witness;
          },
          "An instant at which two things are too near: a dict of `time_s`, `a`, `b` (their names) "
          "and `distance_m`; or None.")
      .def_readonly("broken_limit", &Certification::broken_limit,
                    "The joint's limit that a refuted motion breaks; \"\" where there is none.")
      .def_readonly("certificate", &Certification::certificate,
                    "The text that `sidestep_recheck` accepts; empty where nothing is proven.");

  py::class_<SetProblem>(module, "SetProblem", "A motion among shapes that stand still.")
      .def_readonly("family", &SetProblem::family, "The name of its family.")
      .def_readonly("index", &SetProblem::index, "Within the family, as the set counts.")
      .def_readonly("start", &SetProblem::q_start, "dof values, m or rad.")
      .def_readonly("goal", &SetProblem::q_goal, "dof values, m or rad.")
      .def_property_readonly(
          "scene", [](const SetProblem& p) { return std::const_pointer_cast<Scene>(p.scene); },
          "The shapes, world frame.");

  module
      .def("field_check", &field_check, py::arg("robot").none(false), py::arg("field").none(false),
           py::arg("planning") = py::none(), py::arg("check") = py::none(),
           "The check by the robot's spheres in a field.")
      .def(
          "shape_check", &shape_check, py::arg("robot").none(false), py::arg("world"),
          py::arg("unknown") = "occupied", py::arg("check") = py::none(),
          "The independent check: the robot's own shapes, by FCL, in a scene or among the occupied "
          "voxels of a field. unknown: what its unknown voxels are, \"free\" or \"occupied\".")
      .def("certify", &prove, py::arg("robot").none(false), py::arg("world"), py::arg("trajectory"),
           py::arg("margin_m") = 0.0, py::arg("unknown") = "occupied",
           "Proves over continuous time that a motion keeps clear of a scene that stands still, or "
           "of the occupied voxels of a field, and of itself, and within limits.")
      .def(
          "read_problem_set",
          [](const std::filesystem::path& from, const RobotPtr& robot) {
            return unlocked("problems",
                            [&] { return read_problem_set(from, robot->description()); });
          },
          py::arg("path"), py::arg("robot").none(false),
          "Every problem of a file or folder, in order (docs/reference/problem_sets.md).");

  session.def("planner", &make_planner, py::arg("robot").none(false),
              py::arg("optimiser") = py::none(), py::arg("sampler") = py::none(),
              py::arg("seeds") = std::nullopt, py::arg("planning") = py::none(),
              py::arg("check") = py::none(),
              "An optimiser, a sampling planner or both in a race: blocks, or for the optimiser an "
              "object of a class derived from sidestep.Optimiser. planning, check: the blocks of "
              "a configuration.");
}

}  // namespace sidestep::python
