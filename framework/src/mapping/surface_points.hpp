#pragma once

#include <vector>

#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// Frames from places so far apart are of different cameras, or of one that has moved on.
constexpr double kOtherPlace_m = 0.5;

/// A vertical cylinder to look for points in. World frame.
struct SearchCylinder {
  Eigen::Vector2d axis_m;
  double radius_m;
  double bottom_m, top_m;
};

/// Writes the points of a frame that lie in a cylinder, as many as a few hundred evenly spread rays
/// find. Returns how far neighbours are apart across the line of sight; 0 for clouds. [any]
double find_surface_points(const Frame& frame, const SearchCylinder& cylinder,
                           std::vector<Eigen::Vector3d>& points);

/// Writes about a thousand points of a frame, evenly spread over it. World frame. [any]
void sample_points(const Frame& frame, std::vector<Eigen::Vector3d>& points);

/// Three standard deviations of what a structured-light camera measures at a depth.
[[nodiscard]] double depth_noise_m(double depth_m);

/// Whether a frame sees through places. A frame of points sees through none. [any]
class SeeThrough {
 public:
  enum class Answer { kYes, kPartly, kHit, kNo };
  static constexpr int kMostRays = 8;

  /// The frame must outlive this.
  explicit SeeThrough(const Frame& frame);

  /// Looks at `rays` by `rays`, 2 to kMostRays, of the frame through a cube about a place. Yes:
  /// those that measure anything all measure it behind the cube, by more than noise, and one does.
  /// Hit: one measures something in it, and none behind it. No: none measures anything in it or
  /// behind it; those beside the image measure nothing, and forbid a yes.
  [[nodiscard]] Answer operator()(const Eigen::Vector3d& p_world, double edge_m, int rays) const;

 private:
  const DepthImage* image_;  ///< Null for points.
  Transform T_camera_world_;
};

}  // namespace sidestep
