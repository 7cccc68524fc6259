#include "depth_renderer.hpp"

#include <cmath>
#include <limits>

namespace sidestep::simulator {

constexpr int kGrain_rows = 8;

DepthRenderer::DepthRenderer(const CameraIntrinsics& camera) : camera_(camera) {
  directions_.reserve(static_cast<std::size_t>(camera.width_px) *
                      static_cast<std::size_t>(camera.height_px));
  for (int v = 0; v < camera.height_px; ++v) {
    for (int u = 0; u < camera.width_px; ++u) {
      directions_.push_back(camera.unproject(u, v, 1.0).normalized());
    }
  }
}

void DepthRenderer::render(const RayCaster& caster, const Transform& T_world_camera,
                           WorkerPool& workers, ExactImage& image) const {
  image.depth_m.resize(directions_.size());
  image.cos_incidence.resize(directions_.size());
  const auto width = static_cast<std::size_t>(camera_.width_px);
  const Eigen::Matrix3d R_world_camera = T_world_camera.linear();
  workers.run_banded(camera_.height_px, kGrain_rows, [&](int begin, int end) {
    const std::vector<Eigen::Vector3d> origins(width, T_world_camera.translation());
    std::vector<Eigen::Vector3d> directions_world(width);
    std::vector<RayHit> hits(width);
    for (int v = begin; v < end; ++v) {
      const std::size_t row = static_cast<std::size_t>(v) * width;
      for (std::size_t u = 0; u < width; ++u) {
        directions_world[u] = R_world_camera * directions_[row + u];
      }
      caster.cast(origins, directions_world, hits);
      for (std::size_t u = 0; u < width; ++u) {
        const RayHit& hit = hits[u];
        image.depth_m[row + u] = static_cast<float>(hit.distance_m * directions_[row + u].z());
        image.cos_incidence[row + u] =
            static_cast<float>(std::abs(hit.normal_world.dot(directions_world[u])));
      }
    }
  });
}

}  // namespace sidestep::simulator
