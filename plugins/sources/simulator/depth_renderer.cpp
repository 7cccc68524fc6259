#include "depth_renderer.hpp"

#include <cmath>
#include <limits>

namespace sidestep::simulator {

constexpr int kGrain_rows = 8;

/// One row of pixels, and what casting it needs.
struct DepthRenderer::Row {
  Eigen::Vector3d origin;
  std::vector<Eigen::Vector3d> directions;  ///< World frame.
  std::vector<double> distances_m;
  std::vector<Eigen::Vector3d> origins;
  std::vector<RayHit> hits;
  std::size_t first = 0;  ///< Its first pixel's place in the image.
};

DepthRenderer::DepthRenderer(const CameraIntrinsics& camera, bool with_incidence)
    : camera_(camera), with_incidence_(with_incidence) {
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
  image.cos_incidence.resize(with_incidence_ ? directions_.size() : 0);
  const auto width = static_cast<std::size_t>(camera_.width_px);
  const Eigen::Matrix3d R_world_camera = T_world_camera.linear();
  workers.run_banded(camera_.height_px, kGrain_rows, [&](int begin, int end) {
    Row row;
    row.origin = T_world_camera.translation();
    row.directions.resize(width);
    for (int v = begin; v < end; ++v) {
      row.first = static_cast<std::size_t>(v) * width;
      for (std::size_t u = 0; u < width; ++u) {
        row.directions[u] = R_world_camera * directions_[row.first + u];
      }
      if (with_incidence_) {
        render_incidence(caster, row, image);
      } else {
        render_depth(caster, row, image);
      }
    }
  });
}

void DepthRenderer::render_depth(const RayCaster& caster, Row& row, ExactImage& image) const {
  const std::size_t width = row.directions.size();
  row.distances_m.resize(width);
  caster.cast_distances(row.origin, row.directions, row.distances_m);
  for (std::size_t u = 0; u < width; ++u) {
    const std::size_t at = row.first + u;
    image.depth_m[at] = static_cast<float>(row.distances_m[u] * directions_[at].z());
  }
}

void DepthRenderer::render_incidence(const RayCaster& caster, Row& row, ExactImage& image) const {
  const std::size_t width = row.directions.size();
  row.origins.assign(width, row.origin);
  row.hits.resize(width);
  caster.cast(row.origins, row.directions, row.hits);
  for (std::size_t u = 0; u < width; ++u) {
    const RayHit& hit = row.hits[u];
    const std::size_t at = row.first + u;
    image.depth_m[at] = static_cast<float>(hit.distance_m * directions_[at].z());
    image.cos_incidence[at] = static_cast<float>(std::abs(hit.normal_world.dot(row.directions[u])));
  }
}

}  // namespace sidestep::simulator
