#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/runtime/pipeline.hpp>
#include <sidestep/runtime/replanner.hpp>
#include <sidestep/runtime/truth_check.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// What a run, or one episode of it, takes place in.
struct ObservedWorld {
  std::string title;         ///< E.g. the configuration's name.
  std::int64_t episode = 0;  ///< Of the run; 0 where it has none.
  std::shared_ptr<const RobotModel> robot;
  std::shared_ptr<const Scene> scene;  ///< The true one; null where it is unknown.
  Eigen::VectorXd q_start;
  Eigen::VectorXd q_goal;
};

/// A frame that is in the map. Times on the run's clock.
struct ObservedMap {
  std::shared_ptr<const Frame> frame;
  MappingStep step;
  MapSnapshot snapshot;
  Stamp received;   ///< From the source.
  Stamp published;  ///< When the field could be planned in.
};

/// One step of the planning side.
struct ObservedStep {
  Stamp stamp;           ///< When it began, on the run's clock.
  double step_ms = 0.0;  ///< What it took, wall time.
  Replanner::Status status = Replanner::Status::kWaiting;
  std::int64_t checks = 0;  ///< Validity checks so far.
  Eigen::VectorXd q;        ///< Measured; empty where it is not known.
  Eigen::VectorXd q_true;   ///< Empty where it is unknown, or between two records of it.
  std::shared_ptr<const Tracks> tracks = nullptr;  ///< Of the newest map; null where it has none.
  std::shared_ptr<const Prediction> prediction = nullptr;  ///< Null where nothing is predicted.
};

/// What happened, and what it led to.
struct ObservedEvent {
  ReplannerEvent event;
  std::optional<double> stamp_to_trajectory_ms;  ///< Of plans and replans.
  /// What is followed from now on, and when its time 0 is; null where that did not change.
  std::shared_ptr<const Trajectory> followed;
  Stamp followed_start;
};

/// How a run, or one episode of it, ended.
struct ObservedEnd {
  Stamp stamp;
  bool success = false;
  std::string verdict;  ///< In plain words.
  /// What the robot truly touched, or was touched by, where that is known.
  std::vector<TrueContact> contacts = {};
};

/// Receives an experiment's events: a viewer, a recorder. The threads that do the work call it and
/// wait for it: it keeps what it is handed, which is immutable, and returns.
class RunObserver {
 public:
  virtual ~RunObserver() = default;

  /// Before anything else of an episode. [main]
  virtual void begin(const ObservedWorld& world) = 0;
  /// After each frame. [mapping]
  virtual void mapped(const ObservedMap& map) = 0;
  /// After each step. [planning]
  virtual void stepped(const ObservedStep& step) = 0;
  /// In the step in which it happened, before stepped(). [planning]
  virtual void happened(const ObservedEvent& event) = 0;
  /// After all else of an episode, once no other thread is left. [main]
  virtual void end(const ObservedEnd& end) = 0;
};

}  // namespace sidestep
