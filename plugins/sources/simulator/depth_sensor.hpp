#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/geometry/ray_caster.hpp>
#include <sidestep/sensing/frame.hpp>

#include "simulator.hpp"

namespace sidestep::simulator {

/// What a perfect camera of unlimited range sees, row by row.
struct ExactImage {
  std::vector<float> depth_m;  ///< Along the optical axis; infinity where nothing is.
  /// Of the angle between ray and surface normal, 0 to 1; empty where nobody wants it.
  std::vector<float> cos_incidence;
};

/// One ray through the centre of each pixel.
class DepthRenderer {
 public:
  DepthRenderer(const CameraIntrinsics& camera, bool with_incidence);

  void render(const RayCaster& caster, const Transform& T_world_camera, WorkerPool& workers,
              ExactImage& image) const;

 private:
  struct Row;
  void render_depth(const RayCaster& caster, Row& row, ExactImage& image) const;
  void render_incidence(const RayCaster& caster, Row& row, ExactImage& image) const;

  CameraIntrinsics camera_;
  bool with_incidence_;
  std::vector<Eigen::Vector3d> directions_;  ///< Of unit length, optical frame.
};

/// Depths outside this range return nothing.
struct Range {
  double min_m = 0.0;
  double max_m = 0.0;
};

/// Turns what is there into what a sensor reports: nothing but the range for model `none`; for
/// `kinect`, the errors of a structured-light camera (README.md). The random numbers of a pixel
/// depend on the seed, the frame's number and the pixel alone, not on threads.
class DepthSensor {
 public:
  DepthSensor(const CameraIntrinsics& camera, const Range& range, const NoiseOptions& noise,
              std::uint64_t seed);

  /// Whether the noise depends on how surfaces are inclined.
  [[nodiscard]] bool needs_incidence() const noexcept { return noise_.model != "none"; }

  void measure(const ExactImage& exact, std::int64_t frame, WorkerPool& workers,
               std::vector<float>& depth_m) const;

 private:
  [[nodiscard]] float measure_pixel(const ExactImage& exact, std::uint64_t frame_seed, int u,
                                    int v) const;
  [[nodiscard]] bool is_edge(const ExactImage& exact, int u, int v) const;
  [[nodiscard]] float in_range(double depth_m) const;
  [[nodiscard]] std::size_t index(int u, int v) const;

  CameraIntrinsics camera_;
  Range range_;
  NoiseOptions noise_;
  std::uint64_t seed_;
};

/// Standard deviation of a Kinect's depth along the optical axis, of a surface at `depth_m`
/// whose normal is `incidence_rad` away from the ray (Nguyen, Izadi, Lovell 2012, "Modeling
/// Kinect sensor noise for improved 3D reconstruction and tracking", eq. 3 and 4).
[[nodiscard]] double kinect_axial_sigma_m(double depth_m, double incidence_rad) noexcept;

/// Factor by which the deviation across the axis grows with the angle (ibid., eq. 1): 1 face on.
[[nodiscard]] double kinect_lateral_growth(double incidence_rad) noexcept;

}  // namespace sidestep::simulator
