#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/time.hpp>

namespace sidestep {

/// A thing that moves, or has moved and stands now, as a vertical cylinder. World frame.
struct Track {
  std::int64_t id = 0;  ///< One thing keeps its id for as long as it is tracked; no id returns.
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();  ///< Of the axis, at Tracks::stamp.
  Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();
  /// Of (x, y, vx, vy), in m and m/s.
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Identity();
  double radius_m = 0.0;
  double bottom_m = 0.0;
  double top_m = 0.0;
  Stamp first_seen;
  Stamp last_seen;  ///< Before Tracks::stamp while it is out of sight.
};

/// All that is tracked in one map, as one immutable snapshot.
struct Tracks {
  std::vector<Track> tracks;  ///< By id, ascending.
  Stamp stamp;                ///< Of the newest frame in it.
};

}  // namespace sidestep
