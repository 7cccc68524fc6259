#pragma once

#include <string>

#include <sidestep/field/occupancy_bits.hpp>

#include "node_messages.hpp"

/// What RViz draws of a map, in the world's frame. Each array shows its topic anew. Pure functions.
/// [any]
namespace sidestep::ros1_executor {

/// At most so many squares along either side of a slice.
inline constexpr int kMostSliceSquares = 128;

/// The occupied voxels as cubes, coloured by height.
[[nodiscard]] ros_messages::MarkerArray voxel_markers(const OccupancyBits& voxels,
                                                      const std::string& frame, ::ros::Time stamp);

/// The distances at height `height_m`, which is moved into the grid, as squares of a voxel's width,
/// or of several voxels' where the grid is large: red at 0 and below, over yellow and green to blue
/// where distances are cut off. Where nothing was observed there are none.
[[nodiscard]] ros_messages::MarkerArray slice_markers(const DistanceField& field, double height_m,
                                                      const std::string& frame, ::ros::Time stamp);

}  // namespace sidestep::ros1_executor
