#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/geometry/people.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/mapping/localiser.hpp>
#include <sidestep/measures/map_truth.hpp>
#include <sidestep/planning/executor.hpp>
#include <sidestep/planning/gaze.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/episode_clock.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/localised_executor.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/replanner.hpp>
#include <sidestep/runtime/snapshot_slot.hpp>
#include <sidestep/runtime/task_settings.hpp>
#include <sidestep/sensing/source.hpp>

namespace sidestep {

/// `experiment.latency`: what sensing and computing are charged with, in lockstep.
struct LatencyEntry {
  double sensor_s = 0.0;
  double mapping_s = 0.03;

  static Parameters<LatencyEntry> parameters();
};

/// `experiment.random`: what differs from episode to episode.
struct RandomEntry {
  Node start;
  Node goal;
  double clearance_m = 0.05;
  int draws = 1000;

  static Parameters<RandomEntry> parameters();
};

/// The `experiment` block of a replan experiment.
struct ReplanSettings : ExperimentSettings, TaskEntry {
  std::string clock = "lockstep";
  double duration_s = 60.0;
  double step_s = 0.004;
  int first_episode = 0;
  int episodes = 1;
  LatencyEntry latency;
  std::string perception = "cameras";
  std::vector<std::string> goes_on_without;
  std::optional<std::filesystem::path> cases;
  std::optional<std::filesystem::path> people;
  bool free_run = false;
  RobotStateEntry start;
  RobotStateEntry goal;
  std::optional<RandomEntry> random;
  TruthSettings truth;
  bool tracks = false;
  int pictures = 8;

  static Parameters<ReplanSettings> parameters();
  [[nodiscard]] bool is_lockstep() const { return clock == "lockstep"; }
  [[nodiscard]] bool sees_truth() const { return perception == "truth"; }
};

/// A joint whose position is drawn evenly from a range.
struct RandomJoint {
  std::size_t joint = 0;
  double lower = 0.0;
  double upper = 0.0;
};

/// Where a robot goes among which people in one episode. World frame.
struct CrowdCase {
  Eigen::Vector2d start_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d goal_m = Eigen::Vector2d::Zero();
  Node people;  ///< As the block `people` of a scene has them.
};

/// The cases of episodes one after the other: CrowdNav's, or crossings of a recording.
class CrowdCases {
 public:
  /// Reads experiment.cases or experiment.people; none where neither is given. Appends mistakes.
  [[nodiscard]] static std::optional<CrowdCases> read(const ReplanSettings& settings,
                                                      const Node& experiment,
                                                      std::vector<Error>& errors);
  /// `seed`: the episode's.
  [[nodiscard]] CrowdCase of(std::int64_t episode, std::uint64_t seed) const;

 private:
  std::vector<CrowdCase> cases_;
  std::filesystem::path recording_;
  double duration_s_ = 0.0;
  double first_s_ = 0.0, last_s_ = 0.0;  ///< When crossings may begin.
};

/// All that a configuration says of a replan experiment.
struct ReplanConfiguration {
  ReplanSettings experiment;
  PlanningSettings planning;
  CheckSettings check;
  ReplannerSettings replanner;
  Eigen::VectorXd q_start;
  Eigen::VectorXd q_goal;
  std::vector<RandomJoint> start_ranges;
  std::vector<RandomJoint> goal_ranges;
  std::optional<CrowdCases> cases;
  std::array<int, 2> base{};  ///< With cases: the joints that move the base along x and y.
  Task task;
};

/// Reads the blocks `replanner`, `planning` and `check`; mistakes as below.
void read_loop_blocks(const Configuration& configuration, ReplanConfiguration& into,
                      std::vector<Error>& errors);

/// Reads everything, for this robot. Appends all mistakes that no schema knows of; what does not
/// fit its schema has been told.
[[nodiscard]] ReplanConfiguration read_replan_configuration(
    const Configuration& configuration, const std::shared_ptr<const RobotModel>& robot,
    std::vector<Error>& errors);

/// One of the block `sources`.
struct FurtherSource {
  std::string name;
  PluginPtr<Source> source;
  bool is_needed = true;  ///< Whether the robot stops without it.
};

/// All that an episode has to itself: nothing of it lives on into the next one.
struct ReplanWorld {
  std::unique_ptr<EpisodeClock> clock;
  std::shared_ptr<RobotMotion> motion;
  std::shared_ptr<const RobotModel> robot;
  PluginPtr<Source> source;
  std::vector<FurtherSource> further;  ///< They may know the truth from `source`.
  PluginPtr<Mapper> mapper;
  PluginPtr<FieldBuilder> field_builder;
  PluginPtr<Optimiser> optimiser;
  PluginPtr<Optimiser> sampler;  ///< Null where there is none.
  std::unique_ptr<SnapshotSlot> slot;
  PluginPtr<Executor> executor;
  PluginPtr<Localiser> localiser;                ///< Null where odometry is taken for the truth.
  std::optional<BaseJoints> base;                ///< With a localiser.
  std::unique_ptr<LocalisedExecutor> localised;  ///< The executor, with a localiser.
  PluginPtr<Predictor> predictor;                ///< Null where nothing is predicted.
  PluginPtr<Gaze> gaze;                          ///< Null where the head rests.
  TrueRobot* true_robot = nullptr;     ///< The executor's other side; null where it has none.
  std::shared_ptr<const Scene> scene;  ///< Null where it is not known.
  GroundTruth* truth = nullptr;        ///< The source's other side; null where it has none.
  std::uint64_t seed = 0;              ///< The episode's.
  Eigen::VectorXd q_start;
  Eigen::VectorXd q_goal;

  /// What moves the robot in the map's frame.
  [[nodiscard]] Executor& mover() const {
    return localised ? static_cast<Executor&>(*localised) : *executor;
  }
};

/// The world of an episode: start and goal drawn, the robot at rest at its start, the clock at
/// zero; or, of such a world, the same without people and whatever else moves. Fails where a plugin
/// cannot be made, and where no start or goal is free.
[[nodiscard]] Result<ReplanWorld> make_replan_world(ExperimentContext& context,
                                                    const ReplanConfiguration& settings,
                                                    const std::shared_ptr<const RobotModel>& robot,
                                                    std::int64_t episode,
                                                    const ReplanWorld* alone_in = nullptr);

}  // namespace sidestep
