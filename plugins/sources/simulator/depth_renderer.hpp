#pragma once

#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/geometry/ray_caster.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep::simulator {

/// What a perfect camera of unlimited range sees, row by row.
struct ExactImage {
  std::vector<float> depth_m;        ///< Along the optical axis; infinity where nothing is.
  std::vector<float> cos_incidence;  ///< Of the angle between ray and surface normal, 0 to 1.
};

/// One ray through the centre of each pixel.
class DepthRenderer {
 public:
  explicit DepthRenderer(const CameraIntrinsics& camera);

  void render(const RayCaster& caster, const Transform& T_world_camera, WorkerPool& workers,
              ExactImage& image) const;

 private:
  CameraIntrinsics camera_;
  std::vector<Eigen::Vector3d> directions_;  ///< Of unit length, optical frame.
};

}  // namespace sidestep::simulator
