#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <sidestep/core/time.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/mapping/localiser.hpp>
#include <sidestep/measures/map_truth.hpp>
#include <sidestep/measures/swept_volume.hpp>
#include <sidestep/measures/track_truth.hpp>
#include <sidestep/planning/executor.hpp>
#include <sidestep/planning/gaze.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/episode_clock.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/localised_executor.hpp>
#include <sidestep/runtime/map_show.hpp>
#include <sidestep/runtime/pipeline.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/replanner.hpp>
#include <sidestep/runtime/run_observer.hpp>
#include <sidestep/runtime/sensor_set.hpp>
#include <sidestep/runtime/snapshot_slot.hpp>
#include <sidestep/runtime/task_settings.hpp>
#include <sidestep/sensing/source.hpp>
#include "replan_rows.hpp"

/// What the experiments of the closed loop, `replan` and `deploy`, have in common.

namespace sidestep {

/// `experiment.latency`: what sensing and computing are charged with, in lockstep.
struct LatencyEntry {
  double sensor_s = 0.0;
  double mapping_s = 0.03;

  static Parameters<LatencyEntry> parameters() {
    using E = LatencyEntry;
    return Parameters<E>()
        .add("sensor_s", &E::sensor_s, "From a frame's stamp to when mapping has it.",
             {.unit = "s", .min = 0.0, .max = 60.0})
        .add("mapping_s", &E::mapping_s,
             "From there to its published field; no other frame is mapped meanwhile.",
             {.unit = "s", .min = 0.0, .max = 60.0});
  }
};

/// `experiment.random`: what differs from episode to episode.
struct RandomEntry {
  Node start;
  Node goal;
  double clearance_m = 0.05;
  int draws = 1000;

  static Parameters<RandomEntry> parameters() {
    using E = RandomEntry;
    return Parameters<E>()
        .add("start", &E::start, "Ranges of joints of the start, e.g. {odom_x: [-1.0, 1.0]}.")
        .add("goal", &E::goal, "Ranges of joints of the goal.")
        .add("clearance_m", &E::clearance_m,
             "That a drawn start or goal keeps from everything in the true scene.",
             {.unit = "m", .min = 0.0, .max = 10.0})
        .add("draws", &E::draws, "How often to draw before giving up.", {.min = 1, .max = 1e6});
  }
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
  bool policies = false;
  int pictures = 8;

  static Parameters<ReplanSettings> parameters();
  [[nodiscard]] bool is_lockstep() const { return clock == "lockstep"; }
  /// Declares `policies`, which all loops have.
  template <class Settings>
  static Parameters<Settings> with_policies(Parameters<Settings> parameters) {
    return std::move(parameters)
        .add("policies", &Settings::policies,
             "Holds each step against what docs/closed_loop.md promises; an episode that breaks a "
             "promise is no success.");
  }
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
  /// Where the robot is, in the map's frame.
  [[nodiscard]] Result<Executor::Measured> measured() const {
    return call_plugin(plugin_of(executor), [&] { return mover().current(); });
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

/// The mapping side of an episode: frames that are due become fields in the world's slot, and are
/// shown by an executor that can. Once it has failed or its source has ended, it maps no more, and
/// the map ages.
class EpisodeMapping {
 public:
  /// `observer` may be null; it is shown nothing before show() says so.
  EpisodeMapping(ReplanWorld& world, const ReplanConfiguration& configuration, Log& log,
                 RunObserver* observer);

  /// Binds the field builder to the mapper. Call once, first.
  [[nodiscard]] Result<void> attach() { return pipeline_.attach(); }

  /// Maps the first frame, before the clock runs, or waits for it where a thread maps already; null
  /// where none comes by the deadline, which counts by the wall's clock only.
  std::shared_ptr<const DistanceField> map_first(const Deadline& deadline);

  /// In lockstep: maps the frame that is due, if any, and publishes what the latency has passed
  /// for.
  void advance(Stamp now);

  /// Whether the observer is shown what is mapped from now on. [any]
  void show(bool shows) noexcept { shows_ = shows; }

  /// By the wall's clock: maps in a thread until told to stop, unless it does already.
  void start();
  /// Stops and joins that thread, if there is one.
  void stop();

  /// Whether the mapper has what it takes to find what moves.
  [[nodiscard]] bool finds_what_moves() const noexcept { return occupancy_ != nullptr; }
  /// What keeps new maps from coming, as far as that is known. [any]
  [[nodiscard]] std::string trouble() const;

  /// The next three only in lockstep, or after stop().
  [[nodiscard]] const std::optional<Error>& fault() const noexcept { return fault_; }
  /// Hands over what was mapped since the last call.
  [[nodiscard]] MappingRecord take_record();
  /// Nothing where it was not measured.
  [[nodiscard]] std::optional<MapFollowing> following() const;

 private:
  struct Waiting {
    Stamp due;
    MapSnapshot snapshot;
  };

  /// The frame that was mapped last, in the map's frame.
  [[nodiscard]] std::shared_ptr<const Frame> mapped_frame(const MappingStep& step) const;
  /// Maps the next frame, if one comes before the deadline.
  bool map_one(const Deadline& deadline);
  void note_trouble(const Result<std::optional<MappingStep>>& step);
  void note_frame(MappingStep step);
  /// The map as nobody can see it, published as if it had been mapped.
  void give_truth();

  const Clock& clock_;
  bool is_lockstep_;
  GroundTruth* truth_source_;  ///< Instead of frames; null where those are mapped.
  LatencyEntry latency_;       ///< In lockstep.
  RunObserver* observer_;
  std::atomic<bool> shows_ = false;
  SnapshotSlot& slot_;
  SnapshotSlot made_;  ///< In lockstep: what has been made, but is not to be seen yet.
  SensorSet sensors_;
  MotionDetector motion_detector_;
  Tracker tracker_;
  std::optional<BaseJoints> base_;
  bool is_tracking_;
  bool masks_tracks_;
  std::string source_name_;
  MappingPipeline pipeline_;
  std::deque<Waiting> waiting_;
  Stamp busy_until_;
  bool has_ended_ = false;
  std::optional<Error> fault_;
  std::vector<MappedFrame> frames_;

  mutable std::mutex trouble_mutex_;  ///< Of the next two, which the side that maps writes.
  std::string trouble_;               ///< Empty: frames come, or are waited for.
  std::optional<Stamp> newest_;

  const OccupancyView* occupancy_;         ///< Of the mapper; null where it has none.
  std::optional<MapTruth> truth_;          ///< Where it is measured.
  std::optional<SweptVolume> swept_;       ///< The same.
  std::optional<TrackTruth> track_truth_;  ///< The same, where there are tracks.
  std::jthread thread_;
  std::unique_ptr<MapShow> show_;  ///< By the wall's clock, where the executor shows maps.
};

/// Tells people how far an episode has come, every few seconds of the wall's clock while it goes
/// on: by that clock one may take minutes. One thread.
class EpisodeProgress {
 public:
  using Wall = std::chrono::steady_clock;
  using Tell = std::function<void(const std::string& how_far)>;

  /// Of an episode that begins now, at `begin` of its own clock, and lasts `duration_s` at most.
  /// `tell` may be empty.
  EpisodeProgress(Tell tell, Stamp begin, double duration_s, Wall::time_point wall = Wall::now());

  /// After each step, the last one included.
  void note(Stamp now, Wall::time_point wall = Wall::now());

 private:
  Tell tell_;
  Stamp begin_;
  std::string limit_;
  Wall::time_point told_;
};

/// Asked after each step; why the episode is to end before its goal, or nothing.
using EpisodeWatch = std::function<std::string(Stamp now, const Replanner& replanner)>;

/// What an episode takes place in.
struct EpisodeParts {
  const ReplanConfiguration& settings;
  ReplanWorld& world;
  EpisodeMapping& mapping;         ///< Attached.
  EpisodeWatch watch;              ///< May be empty.
  EpisodeProgress::Tell progress;  ///< May be empty.
  bool is_certified = true;        ///< Where the settings ask for certificates of what is followed.
};

/// Runs one episode: the closed loop of Finean 2021, Algorithm 1, by the clock that the settings
/// name, from where the clock is, and then what truly happened. Leaves the robot at rest and nobody
/// mapping. A task that fails, a plugin that fails while the robot moves, are a record with a
/// reason; an error is one that leaves nothing to measure. [main]
[[nodiscard]] Result<EpisodeRecord> run_episode(ExperimentContext& context,
                                                const EpisodeParts& parts, std::int64_t episode);

/// Certifies what was followed, each motion for as long as it was, among what the map held as it
/// began, counts them, and leaves the certificates of those that are proven in the run's folder,
/// certificates/episode-EPISODE/MOTION.json. Fails as leave_certificate() does.
[[nodiscard]] Result<void> certify_motions(const RobotModel& robot, const SpacePolicy& space,
                                           const std::filesystem::path& run,
                                           EpisodeRecord& episode);

/// What both read of a configuration, and how their runs are shown.
class LoopExperiment : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override;
  [[nodiscard]] const report::RunReport& report() const override;
};

/// Appends the mistakes in the names of links that both read.
void check_loop_names(const Configuration& configuration, const RobotDescription& robot,
                      std::vector<Error>& errors);

/// How a run of a closed loop ended.
struct LoopEnd {
  bool interrupted = false;
  std::optional<Error> fault;  ///< That ended it early.
};

/// The head of a run. `identity`: of one whose episodes can be run again; empty where they cannot.
[[nodiscard]] ReplanHead replan_head(const ExperimentContext& context,
                                     const ReplanConfiguration& settings,
                                     const RobotDescription& robot, const std::string& identity);

/// Does the work with a recorder of the run's results store, new or gone on with, and concludes
/// from what it committed, even where it failed. Fails with that where there is not one episode.
[[nodiscard]] Result<ExperimentOutcome> run_loop(
    const ExperimentContext& context, const std::string& experiment, const ReplanHead& head,
    const std::function<Result<void>(Recorder& recorder)>& work);

/// Verdict, summary.json and table of a finished (or interrupted) run of that type.
[[nodiscard]] ExperimentOutcome summarise_replan(const std::string& experiment,
                                                 const ReplanRows& rows, const LoopEnd& end = {});

/// Result of a run: keys of summary.json, and how they are shown.
[[nodiscard]] const report::ResultColumnsOf<ReplanRows>& replan_metrics();

}  // namespace sidestep
