#pragma once

#include <string>
#include <vector>

#include <sidestep/runtime/results_store.hpp>

#include "plan_recording.hpp"

namespace sidestep {

/// What a pixel of a slice is.
enum class SliceState { kFree = 0, kUnknown = 1, kOccupied = 2, kOutside = 3 };

/// A cut through the field and through the robot's way, in coordinates (u, v) of a plane. Rows
/// of the arrays run along v, upwards.
struct FieldSlice {
  std::string title;
  std::string u_label;
  std::string v_label;
  double u0_m = 0.0;  ///< Of the first pixel's centre.
  double v0_m = 0.0;
  double step_m = 0.0;
  StoredArray distance_m;
  StoredArray state;      ///< SliceState.
  StoredArray circles;    ///< n x 4: u, v, radius, share of the motion's time (0 to 1).
  StoredArray base_path;  ///< n x 2, projected onto the plane; empty if the base stands still.
  StoredArray tip_path;   ///< n x 2.
};

/// Horizontal cuts at heights that matter to the plan, then one vertical cut through the robot
/// where it ends. A plan without a trajectory shows its start and its goal.
[[nodiscard]] std::vector<FieldSlice> cut_slices(const PlanRecord& plan,
                                                 const PlanSurroundings& around);

}  // namespace sidestep
