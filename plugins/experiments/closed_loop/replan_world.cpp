#include "replan_world.hpp"

#include <algorithm>
#include <random>

#include <sidestep/core/seed.hpp>
#include <sidestep/measures/source_facts.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/shape_check.hpp>

namespace sidestep {
namespace {

/// Creates the plugin that a block names; the first failure is kept, and nothing made after it.
class Maker {
 public:
  Maker(const Configuration& configuration, Host& host, RunLoan loan)
      : configuration_(configuration), host_(host), loan_(std::move(loan)) {}

  template <class Interface>
  void make(std::string_view block, PluginPtr<Interface>& into) {
    make(block_of(configuration_, block), into);
  }
  template <class Interface>
  void make(const Node& block, PluginPtr<Interface>& into) {
    if (error_) return;
    auto made = host_.create<Interface>(block, loan_);
    if (made) {
      into = std::move(*made);
    } else {
      error_ = std::move(made.error());
    }
  }
  [[nodiscard]] std::optional<Error>& error() { return error_; }

 private:
  const Configuration& configuration_;
  Host& host_;
  RunLoan loan_;
  std::optional<Error> error_;
};

/// Draws a start or goal until it is free of itself and of the scene at a time.
class StateDraw {
 public:
  StateDraw(const ReplanConfiguration& settings, std::shared_ptr<const RobotModel> robot,
            std::shared_ptr<const Scene> scene)
      : settings_(settings), robot_(std::move(robot)), scene_(std::move(scene)) {}

  Result<Eigen::VectorXd> draw(const std::string& what, Eigen::VectorXd q,
                               const std::vector<RandomJoint>& ranges, double scene_time_s,
                               std::uint64_t seed) const {
    if (ranges.empty()) return q;
    const RandomEntry& random = *settings_.experiment.random;
    ShapeObstacles obstacles;
    obstacles.scene = scene_;
    obstacles.scene_time_s = scene_time_s;
    ShapeCheckSettings touching;
    if (scene_) {
      const auto& allowed = settings_.check.allowed_contacts;
      touching.allowed_contacts.assign(allowed.begin(), allowed.end());
    }
    auto check = SIDESTEP_TRY(make_shape_check(robot_, obstacles, touching));
    std::mt19937_64 generator(derive_seed(seed, what));
    for (int i = 0; i < random.draws; ++i) {
      for (const RandomJoint& range : ranges) {
        const double share = std::uniform_real_distribution<double>(0.0, 1.0)(generator);
        q[static_cast<Eigen::Index>(range.joint)] =
            range.lower + share * (range.upper - range.lower);
      }
      Trajectory standing = make_trajectory(robot_->description().dof(), 2, 1e-3);
      for (int state : {0, 1}) std::copy(q.begin(), q.end(), standing.q(state).begin());
      const auto verdict = SIDESTEP_TRY(check->check(standing, 0.0, Deadline()));
      const bool is_free = verdict.valid() && verdict.min_clearance_m >= random.clearance_m;
      if (is_free) return q;
    }
    return fail(ErrorCode::kConfig,
                "no free " + what + " was found in " + std::to_string(random.draws) + " draws",
                "experiment.random." + what, "wider ranges, or less clearance_m");
  }

 private:
  const ReplanConfiguration& settings_;
  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const Scene> scene_;
};

/// Start and goal of this episode.
Result<void> draw_ends(const ReplanConfiguration& settings, std::uint64_t seed,
                       ReplanWorld& world) {
  const StateDraw states(settings, world.robot, world.scene);
  auto start =
      SIDESTEP_TRY(states.draw("start", settings.q_start, settings.start_ranges, 0.0, seed));
  auto goal = SIDESTEP_TRY(states.draw("goal", settings.q_goal, settings.goal_ranges,
                                       settings.experiment.duration_s, seed));
  world.q_start = std::move(start);
  world.q_goal = std::move(goal);
  return {};
}

/// The executor's block, which says where the robot stands if it is an executor that can be told.
Node executor_block(const Node& block, const ReplanWorld& world, Host& host) {
  const auto info = host.find(PluginKind::kExecutor, block);
  if (!info || block.find("start") != nullptr) return block;
  if (std::ranges::find(info->schema, "start", &Parameter::name) == info->schema.end()) {
    return block;
  }
  const SourceMark mark{"the start of the episode", 0, 0};
  Node::Map start;
  const RobotDescription& robot = world.robot->description();
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    const double q = world.q_start[static_cast<Eigen::Index>(j)];
    start.push_back(
        {robot.joints[j].name, mark, Node(Node::Scalar{detail::number_text(q), false}, mark)});
  }
  Node told = block;
  told.entries().push_back({"start", mark, Node(std::move(start), mark)});
  return told;
}

}  // namespace

std::shared_ptr<const RobotModel> make_run_robot(const Configuration& configuration, Host& host,
                                                 std::vector<Error>& errors) {
  auto made = host.create<RobotModel>(block_of(configuration, "robot"));
  if (made) return std::move(*made);
  errors.push_back(std::move(made.error()));
  return nullptr;
}

Result<ReplanWorld> make_replan_world(ExperimentContext& context,
                                      const ReplanConfiguration& settings,
                                      const std::shared_ptr<const RobotModel>& robot,
                                      std::int64_t episode) {
  const std::uint64_t seed = derive_seed(context.seed, "episode/" + std::to_string(episode));
  ReplanWorld world;
  world.seed = seed;
  world.clock = std::make_unique<EpisodeClock>();
  world.motion = std::make_shared<RobotMotion>();
  world.robot = robot;
  Maker maker(context.configuration, context.host, {robot, world.motion, world.clock.get(), seed});
  maker.make("source", world.source);
  if (maker.error()) return tl::make_unexpected(std::move(*maker.error()));
  auto scene = SIDESTEP_TRY(true_scene(world.source));
  world.scene = std::move(scene);
  SIDESTEP_TRY(draw_ends(settings, seed, world));
  maker.make("mapper", world.mapper);
  maker.make("field", world.field_builder);
  maker.make("optimiser", world.optimiser);
  if (!block_of(context.configuration, "sampler").is_null()) maker.make("sampler", world.sampler);
  maker.make(executor_block(block_of(context.configuration, "executor"), world, context.host),
             world.executor);
  if (maker.error()) return tl::make_unexpected(std::move(*maker.error()));
  world.true_robot = dynamic_cast<TrueRobot*>(world.executor.get());
  return world;
}

}  // namespace sidestep
