#pragma once

#include <chrono>
#include <memory>
#include <string>

#include <ros/node_handle.h>

#include <sidestep/field/occupancy_bits.hpp>

#include "options.hpp"

namespace sidestep::ros1_executor {

/// The topics on which RViz sees the map. One thread at a time, which may be another than the
/// executor's.
class MapView {
 public:
  /// The process is a node of ROS. `frame`: the world's.
  MapView(const MapMarkerOptions& options, std::string frame);

  /// Whether a picture is due, and somebody sees one of them.
  [[nodiscard]] bool is_wanted() const;
  /// Publishes what is seen; without subscribers, nothing is computed.
  void show(std::shared_ptr<const DistanceField> field);

 private:
  using SteadyClock = std::chrono::steady_clock;

  MapMarkerOptions options_;
  std::string frame_;
  SteadyClock::time_point next_ = SteadyClock::time_point::min();
  OccupancyBits voxels_;
  ::ros::NodeHandle node_;
  ::ros::Publisher voxel_topic_;
  ::ros::Publisher slice_topic_;
};

}  // namespace sidestep::ros1_executor
