#pragma once

#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/geometry/ray_caster.hpp>
#include <sidestep/sensing/frame.hpp>

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

}  // namespace sidestep::simulator
