#pragma once

#include <cstdint>
#include <span>

#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/results/recorder.hpp>
#include "frame_tap.hpp"
#include "plan_types.hpp"

namespace sidestep {

/// Series "frame": times and counts of one frame.
void record_frame(const MappingStep& step, std::int64_t item, Recorder& recorder);
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
