#include "map_view.hpp"

#include <utility>

#include "map_markers.hpp"

namespace sidestep::ros1_executor {

MapView::MapView(const MapMarkerOptions& options, std::string frame)
    : options_(options), frame_(std::move(frame)) {
  if (options_.rate_hz <= 0.0) return;
  // Who comes between two pictures sees the last one.
  voxel_topic_ = node_.advertise<ros_messages::MarkerArray>(options_.voxels_topic, 1, true);
  slice_topic_ = node_.advertise<ros_messages::MarkerArray>(options_.slice_topic, 1, true);
}

bool MapView::is_wanted() const {
  if (options_.rate_hz <= 0.0 || SteadyClock::now() < next_) return false;
  return voxel_topic_.getNumSubscribers() > 0 || slice_topic_.getNumSubscribers() > 0;
}

void MapView::show(std::shared_ptr<const DistanceField> field) {
  const ::ros::Time stamp = ::ros::Time::now();
  if (slice_topic_.getNumSubscribers() > 0) {
    slice_topic_.publish(slice_markers(*field, options_.slice_height_m, frame_, stamp));
  }
  if (voxel_topic_.getNumSubscribers() > 0) {
    voxels_.update(std::move(field));
    voxel_topic_.publish(voxel_markers(voxels_, frame_, stamp));
  } else {
    voxels_.clear();
  }
  // Counted from the end: what takes long is shown less often.
  next_ = SteadyClock::now() + std::chrono::duration_cast<SteadyClock::duration>(
                                   std::chrono::duration<double>(1.0 / options_.rate_hz));
}

}  // namespace sidestep::ros1_executor
