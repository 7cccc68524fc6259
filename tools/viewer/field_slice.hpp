#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/field/distance_field.hpp>

#include "view_message.hpp"

namespace sidestep {

/// Distances on a plane across a field.
struct FieldSlice {
  static constexpr std::int16_t kUnknown = -32768;
  static constexpr int kMostSamples = 256;  ///< Along either axis.

  SliceRequest request;                   ///< Its position moved into the grid.
  Eigen::Vector3d first_m;                ///< The first sample.
  double step_m = 0.0;                    ///< From one sample to the next; whole voxels.
  int columns = 0;                        ///< Along the first of the other axes.
  int rows = 0;                           ///< Along the second one.
  double max_distance_m = 0;              ///< Where distances are cut off.
  std::vector<std::int16_t> distance_mm;  ///< Row by row; kUnknown where nothing was observed.
};

/// The slice that a page asks for: at every voxel's centre, or at every n-th one's of a large grid.
[[nodiscard]] FieldSlice make_slice(const DistanceField& field, const SliceRequest& request);

}  // namespace sidestep
