#include <cmath>
#include <limits>

#include <sidestep/planning/costs.hpp>

namespace sidestep {
namespace {

/// Turns what a field says of a point that was never observed, or is outside, into what that counts
/// as.
void apply(const SpacePolicy& policy, const GridSpec& grid, const Eigen::Vector3d& p_m,
           FieldStatus status, double& distance_m, Eigen::Vector3d& gradient) noexcept {
  if (status == FieldStatus::kKnown || !p_m.allFinite()) return;
  if (status == FieldStatus::kUnknown) {
    if (policy.unknown == Space::kFree) return;
    if (!(distance_m <= 0.0)) distance_m = 0.0;
    if (!gradient.allFinite()) gradient.setZero();
  } else if (policy.outside == Space::kFree) {
    distance_m = std::numeric_limits<double>::infinity();
    gradient.setZero();
  } else {
    const Eigen::Vector3d inwards = p_m.cwiseMax(grid.origin_m).cwiseMin(grid.upper_m()) - p_m;
    const double outside_m = inwards.norm();
    distance_m = -outside_m;
    gradient.setZero();
    if (outside_m > 0.0) gradient = inwards / outside_m;
  }
}

}  // namespace

void query_with_policy(const DistanceField& field, const SpacePolicy& policy,
                       std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
                       std::span<Eigen::Vector3d> gradients,
                       std::span<FieldStatus> statuses) noexcept {
  field.query(points_m, distances_m, gradients, statuses);
  Eigen::Vector3d unwanted = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    apply(policy, field.info().grid, points_m[i], statuses[i], distances_m[i],
          gradients.empty() ? unwanted : gradients[i]);
  }
}

std::size_t query_below_with_policy(const DistanceField& field, const SpacePolicy& policy,
                                    std::span<const PointFloats> points_m,
                                    std::span<const double> limits_m,
                                    std::span<FieldSample> samples) noexcept {
  const bool also_unknown = policy.unknown == Space::kOccupied;
  const std::size_t found = field.query_below(points_m, limits_m, also_unknown, samples);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < found; ++i) {
    FieldSample& sample = samples[i];
    const std::size_t block = sample.point / kFloatLanes, lane = sample.point % kFloatLanes;
    const PointFloats& in_m = points_m[block];
    apply(policy, field.info().grid, {in_m.x[lane], in_m.y[lane], in_m.z[lane]}, sample.status,
          sample.distance_m, sample.gradient);
    if (sample.distance_m >= limits_m[block]) continue;
    if (kept != i) samples[kept] = sample;
    ++kept;
  }
  return kept;
}

}  // namespace sidestep
