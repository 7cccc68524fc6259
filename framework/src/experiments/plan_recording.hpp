#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "frame_tap.hpp"
#include "plan_types.hpp"

namespace sidestep {

/// Adds to a store and keeps the first failure, so that recording reads without a check a line.
class Recorder {
 public:
  explicit Recorder(ResultsStore& store) : store_(store) {}

  template <class Value>
  void add(std::string_view series, std::int64_t item, std::string_view key, const Value& value) {
    if constexpr (std::is_arithmetic_v<Value>) {
      note(store_.add(series, item, key, static_cast<double>(value)));
    } else {
      note(store_.add(series, item, key, value));
    }
  }
  /// The same, but for an array without values: nothing.
  void add_filled(std::string_view series, std::int64_t item, std::string_view key,
                  const StoredArray& array) {
    if (!array.values.empty()) add(series, item, key, array);
  }
  /// Commits; the first failure since the last call, if there was one.
  [[nodiscard]] Result<void> commit();

 private:
  void note(Result<void> result) {
    if (!result && !error_) error_ = std::move(result.error());
  }
  ResultsStore& store_;
  std::optional<Error> error_;
};

/// Series "frame": times and counts of one frame.
void record_frame(const MappingStep& step, std::int64_t item, Recorder& recorder);
/// Series "bad_frame": what was wrong with each frame that could not be used.
void record_bad_frames(std::span<const Error> bad_frames, Recorder& recorder);
/// Series "depth": the kept depth images.
void record_depth_pictures(std::span<const DepthPicture> pictures, Recorder& recorder);
/// Series "joint": names, units and limits.
void record_joints(const RobotDescription& robot, Recorder& recorder);

/// What a plan is drawn against.
struct PlanSurroundings {
  const RobotModel& robot;
  const DistanceField& field;
  SpacePolicy space;
  const OccupancyView& occupancy;
  double speed_fraction = 1.0;
  double margin_m = 0.0;
  std::span<const double> slice_heights_m;  ///< Empty: chosen from the plan.
};

/// Series "plan" (one item a plan), and of the plan with index `item`: "trajectory/ITEM"
/// (support states), "motion/ITEM" (joints and clearance, sampled densely over time) and
/// "slice/ITEM" (the field, the robot's cut spheres and the paths of base and hand).
void record_plan(const PlanRecord& plan, std::int64_t item, const PlanSurroundings& surroundings,
                 Recorder& recorder);

}  // namespace sidestep
