#include "depth_sensor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "pixel_random.hpp"

namespace sidestep::simulator {
namespace {

constexpr int kNoiseGrain_rows = 16;
constexpr double kQuarterTurn_rad = 0.5 * std::numbers::pi;
/// Beyond this the measurements behind the model end.
constexpr double kSteepest_rad = 1.5;

}  // namespace

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

double kinect_axial_sigma_m(double depth_m, double incidence_rad) noexcept {
  const double face_on = 0.0012 + 0.0019 * (depth_m - 0.4) * (depth_m - 0.4);
  if (incidence_rad <= std::numbers::pi / 3.0) return face_on;
  const double angle = std::min(incidence_rad, kSteepest_rad);
  const double ratio = angle / (kQuarterTurn_rad - angle);
  return face_on + 0.0001 / std::sqrt(depth_m) * ratio * ratio;
}

double kinect_lateral_growth(double incidence_rad) noexcept {
  const double angle = std::min(incidence_rad, kSteepest_rad);
  return 1.0 + 0.035 / 0.8 * angle / (kQuarterTurn_rad - angle);
}

DepthSensor::DepthSensor(const CameraIntrinsics& camera, const Range& range,
                         const NoiseOptions& noise, std::uint64_t seed)
    : camera_(camera), range_(range), noise_(noise), seed_(seed) {}

void DepthSensor::measure(const ExactImage& exact, std::int64_t frame, WorkerPool& workers,
                          std::vector<float>& depth_m) const {
  depth_m.resize(exact.depth_m.size());
  const bool ideal = !needs_incidence();
  const std::uint64_t frame_seed = mix(seed_ ^ mix(static_cast<std::uint64_t>(frame)));
  workers.run_banded(camera_.height_px, kNoiseGrain_rows, [&](int begin, int end) {
    for (int v = begin; v < end; ++v) {
      for (int u = 0; u < camera_.width_px; ++u) {
        const std::size_t at = index(u, v);
        depth_m[at] = ideal ? in_range(exact.depth_m[at]) : measure_pixel(exact, frame_seed, u, v);
      }
    }
  });
}

float DepthSensor::measure_pixel(const ExactImage& exact, std::uint64_t frame_seed, int u,
                                 int v) const {
  PixelRandom random(frame_seed, index(u, v));
  if (random.uniform() < noise_.random_dropout) return 0.0F;
  if (random.uniform() < noise_.edge_dropout && is_edge(exact, u, v)) return 0.0F;

  const auto incidence_rad = [&](std::size_t at) {
    return std::acos(std::min(1.0, static_cast<double>(exact.cos_incidence[at])));
  };
  // The pixel sees the surface a little beside its own ray.
  const double sigma_px =
      noise_.lateral_sigma_px * kinect_lateral_growth(incidence_rad(index(u, v)));
  const auto [du, dv] = random.normals();
  const double column = std::clamp(std::round(u + sigma_px * du), 0.0, camera_.width_px - 1.0);
  const double row = std::clamp(std::round(v + sigma_px * dv), 0.0, camera_.height_px - 1.0);
  const std::size_t seen = index(static_cast<int>(column), static_cast<int>(row));
  const double exact_m = exact.depth_m[seen];
  if (in_range(exact_m) == 0.0F || incidence_rad(seen) > noise_.grazing_limit_rad) return 0.0F;

  double depth_m = exact_m + noise_.axial_scale *
                                 kinect_axial_sigma_m(exact_m, incidence_rad(seen)) *
                                 random.normals().first;
  if (!(depth_m > 0.0)) return 0.0F;
  if (noise_.disparity_step_px > 0.0) {
    const double scale = camera_.fx_px * noise_.baseline_m / noise_.disparity_step_px;
    depth_m = scale / std::max(std::round(scale / depth_m), 1.0);
  }
  return in_range(depth_m);
}

bool DepthSensor::is_edge(const ExactImage& exact, int u, int v) const {
  const float here = exact.depth_m[index(u, v)];
  const auto jumps_to = [&](int column, int row) {
    if (column < 0 || column >= camera_.width_px || row < 0 || row >= camera_.height_px) {
      return false;
    }
    return std::abs(exact.depth_m[index(column, row)] - here) > noise_.edge_jump_m;
  };
  return jumps_to(u - 1, v) || jumps_to(u + 1, v) || jumps_to(u, v - 1) || jumps_to(u, v + 1);
}

float DepthSensor::in_range(double depth_m) const {
  return depth_m >= range_.min_m && depth_m <= range_.max_m ? static_cast<float>(depth_m) : 0.0F;
}

std::size_t DepthSensor::index(int u, int v) const {
  return static_cast<std::size_t>(v) * static_cast<std::size_t>(camera_.width_px) +
         static_cast<std::size_t>(u);
}

}  // namespace sidestep::simulator
