#include <sidestep/field/scene_field.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/field/distance_field.hpp>

#include "solid.hpp"

namespace sidestep {
namespace {

constexpr double kResolution_m = 1e-3;  ///< Of the bounds.

FieldInfo info_of(Stamp time, const Eigen::AlignedBox3d& bounds_m) {
  FieldInfo info;
  info.grid.resolution_m = kResolution_m;
  info.grid.origin_m = bounds_m.min();
  info.grid.size_vox =
      (bounds_m.sizes() / kResolution_m).array().round().max(1.0).cast<int>().matrix();
  info.is_signed = true;
  info.is_exact = true;
  info.max_distance_m = kInfinity;
  info.lipschitz = 1.0;
  info.stamp = time;
  return info;
}

std::shared_ptr<const Scene> stopped(const Scene& scene, double time_s) {
  std::vector<SceneObject> objects = scene.objects();
  for (SceneObject& object : objects) {
    object.waypoints = {{time_s, object.T_world_object(time_s)}};
  }
  return std::make_shared<const Scene>(std::move(objects));
}

}  // namespace

std::size_t DistanceField::query_below(std::span<const PointFloats> points_m,
                                       std::span<const double> limits_m, bool also_unknown,
                                       std::span<FieldSample> samples) const noexcept {
  std::array<Eigen::Vector3d, kFloatLanes> unpacked_m, gradients;
  std::array<double, kFloatLanes> distances_m;
  std::array<FieldStatus, kFloatLanes> statuses;
  std::size_t written = 0;
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    for (std::size_t lane = 0; lane < kFloatLanes; ++lane) {
      unpacked_m[lane] = {points_m[i].x[lane], points_m[i].y[lane], points_m[i].z[lane]};
    }
    query(unpacked_m, distances_m, gradients, statuses);
    for (std::size_t lane = 0; lane < kFloatLanes; ++lane) {
      const bool counts = statuses[lane] == FieldStatus::kOutside ||
                          (also_unknown && statuses[lane] == FieldStatus::kUnknown);
      if (!counts && distances_m[lane] >= limits_m[i]) continue;
      samples[written++] = {i * kFloatLanes + lane, statuses[lane], distances_m[lane],
                            gradients[lane]};
    }
  }
  return written;
}

/// What is nearest to kLanes points.
struct SceneField::Nearest {
  PointLanes asked_m;
  PointLanes inside_m;  ///< The nearest points within the bounds.
  alignas(64) double distances_m[kLanes];
  alignas(64) double numbers[kLanes];  ///< Of the solid; -1 for none.
  bool is_finite[kLanes];
  bool is_inside[kLanes];
};

SceneField::SceneField(const Scene& scene, Stamp time, const Eigen::AlignedBox3d& bounds_m)
    : DistanceField(info_of(time, bounds_m)), scene_(stopped(scene, time.seconds())) {
  for (const SceneObject& object : scene.objects()) {
    solids_.push_back(detail::make_solid(object, time.seconds()));
  }
  const auto is_plain = [](const detail::Solid& solid) {
    return solid.kind != detail::Solid::Kind::kMesh;
  };
  plain_ = idx(std::ranges::stable_partition(solids_, is_plain).begin() - solids_.begin());
  bounds_ = detail::bounds_of(std::span(solids_).first(plain_));
  numbers_.resize(solids_.size());
  std::iota(numbers_.begin(), numbers_.end(), std::uint32_t{0});
}

SceneField::~SceneField() = default;

/// Looks for what is nearer than a limit.
void SceneField::find_nearest(const PointLanes& points_m, double limit_m,
                              Nearest& nearest) const noexcept {
  const GridSpec& grid = info().grid;
  const Eigen::Vector3d low = grid.origin_m, high = grid.upper_m();
  nearest.asked_m = points_m;
  const double* asked[] = {points_m.x, points_m.y, points_m.z};
  double* inside[] = {nearest.inside_m.x, nearest.inside_m.y, nearest.inside_m.z};
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    nearest.is_finite[lane] = nearest.is_inside[lane] = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double value = asked[axis][lane];
      const double lowest = low[static_cast<int>(axis)], highest = high[static_cast<int>(axis)];
      const double clamped = value > lowest ? std::min(value, highest) : lowest;
      inside[axis][lane] = clamped;
      nearest.is_finite[lane] &= std::isfinite(value);
      nearest.is_inside[lane] &= value == clamped;
    }
    nearest.distances_m[lane] = limit_m;
    nearest.numbers[lane] = -1.0;
  }
  detail::find_nearest_solids(solids_.data(), bounds_, nearest.inside_m, limit_m,
                              nearest.distances_m, nearest.numbers);
  for (std::size_t i = plain_; i < solids_.size(); ++i) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const Eigen::Vector3d p(inside[0][lane], inside[1][lane], inside[2][lane]);
      const double least_m = (p - solids_[i].p_world_shape).norm() - solids_[i].reach_m;
      if (least_m >= nearest.distances_m[lane]) continue;
      const double distance_m = detail::mesh_distance_m(solids_[i], p);
      if (!(distance_m < nearest.distances_m[lane])) continue;
      nearest.distances_m[lane] = distance_m;
      nearest.numbers[lane] = static_cast<double>(i);
    }
  }
}

FieldSample SceneField::sample(const Nearest& nearest, std::size_t lane) const noexcept {
  FieldSample sample{0, FieldStatus::kKnown, nearest.distances_m[lane], Eigen::Vector3d::Zero()};
  if (!nearest.is_inside[lane]) sample.status = FieldStatus::kOutside;
  if (!nearest.is_finite[lane]) {
    sample.distance_m = std::numeric_limits<double>::quiet_NaN();
    return sample;
  }
  if (nearest.numbers[lane] < 0.0) return sample;
  const PointLanes& in_m = nearest.inside_m;
  const detail::Solid& solid = solids_[idx(nearest.numbers[lane])];
  sample.gradient = detail::gradient_of(solid, {in_m.x[lane], in_m.y[lane], in_m.z[lane]});
  const PointLanes& asked_m = nearest.asked_m;
  if (asked_m.x[lane] != in_m.x[lane]) sample.gradient.x() = 0.0;
  if (asked_m.y[lane] != in_m.y[lane]) sample.gradient.y() = 0.0;
  if (asked_m.z[lane] != in_m.z[lane]) sample.gradient.z() = 0.0;
  return sample;
}

void SceneField::query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
                       std::span<Eigen::Vector3d> gradients,
                       std::span<FieldStatus> statuses) const noexcept {
  Nearest nearest;
  for (std::size_t first = 0; first < points_m.size(); first += kLanes) {
    const std::size_t count = std::min(kLanes, points_m.size() - first);
    PointLanes group;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const Eigen::Vector3d& p = points_m[first + std::min(lane, count - 1)];
      group.x[lane] = p.x();
      group.y[lane] = p.y();
      group.z[lane] = p.z();
    }
    find_nearest(group, kInfinity, nearest);
    for (std::size_t lane = 0; lane < count; ++lane) {
      if (gradients.empty()) {
        distances_m[first + lane] = nearest.is_finite[lane]
                                        ? nearest.distances_m[lane]
                                        : std::numeric_limits<double>::quiet_NaN();
      } else {
        const FieldSample found = sample(nearest, lane);
        distances_m[first + lane] = found.distance_m;
        gradients[first + lane] = found.gradient;
      }
      if (!statuses.empty()) {
        statuses[first + lane] =
            nearest.is_inside[lane] ? FieldStatus::kKnown : FieldStatus::kOutside;
      }
    }
  }
}

std::size_t SceneField::query_below(std::span<const PointFloats> points_m,
                                    std::span<const double> limits_m, bool /*also_unknown*/,
                                    std::span<FieldSample> samples) const noexcept {
  std::size_t written = 0;
  Nearest nearest;
  PointLanes group_m;
  for (std::size_t first = 0; first < points_m.size() * kFloatLanes; first += kLanes) {
    const PointFloats& from_m = points_m[first / kFloatLanes];
    const double limit_m = limits_m[first / kFloatLanes];
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      group_m.x[lane] = static_cast<double>(from_m.x[first % kFloatLanes + lane]);
      group_m.y[lane] = static_cast<double>(from_m.y[first % kFloatLanes + lane]);
      group_m.z[lane] = static_cast<double>(from_m.z[first % kFloatLanes + lane]);
    }
    find_nearest(group_m, limit_m, nearest);
    const bool all_inside = std::ranges::all_of(nearest.is_inside, std::identity());
    if (!all_inside) find_nearest(group_m, kInfinity, nearest);  // these have no limit
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (nearest.is_inside[lane] && !(nearest.distances_m[lane] < limit_m)) continue;
      samples[written] = sample(nearest, lane);
      samples[written++].point = first + lane;
    }
  }
  return written;
}

std::size_t SceneField::find_within(std::span<const std::uint32_t> shapes,
                                    const PointLanes& points_m, const double* limits_m,
                                    std::uint32_t* near, double* is_near) const noexcept {
  std::size_t plain = shapes.size();
  while (plain > 0 && shapes[plain - 1] >= plain_) --plain;
  const auto meshes = shapes.subspan(plain);
  const std::uint32_t* numbers = shapes.data();
  if (numbers == numbers_.data() && plain == plain_) {  // all of them: most are far away
    const double limit_m = *std::max_element(limits_m, limits_m + kLanes);
    plain = detail::find_solids_beside(bounds_, points_m, limit_m, near);
    numbers = near;
  }
  std::size_t found =
      detail::find_solids_within(solids_.data(), numbers, plain, points_m, limits_m, near, is_near);
  for (const std::uint32_t number : meshes) {
    const detail::Solid& solid = solids_[number];
    bool is_any = false;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const Eigen::Vector3d p(points_m.x[lane], points_m.y[lane], points_m.z[lane]);
      const double least_m = (p - solid.p_world_shape).norm() - solid.reach_m;
      if (least_m >= limits_m[lane] || detail::mesh_distance_m(solid, p) >= limits_m[lane]) {
        continue;
      }
      is_near[lane] = 1.0;
      is_any = true;
    }
    if (is_any) near[found++] = number;
  }
  return found;
}

}  // namespace sidestep
