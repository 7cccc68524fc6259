#include <cmath>
#include <limits>

#include <sidestep/planning/costs.hpp>

namespace sidestep {
namespace {

void set_gradient(std::span<Eigen::Vector3d> gradients, std::size_t i,
                  const Eigen::Vector3d& gradient) noexcept {
  if (!gradients.empty()) gradients[i] = gradient;
}

}  // namespace

void query_with_policy(const DistanceField& field, const SpacePolicy& policy,
                       std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
                       std::span<Eigen::Vector3d> gradients,
                       std::span<FieldStatus> statuses) noexcept {
  field.query(points_m, distances_m, gradients, statuses);
  const Eigen::Vector3d lower_m = field.info().grid.origin_m;
  const Eigen::Vector3d upper_m = field.info().grid.upper_m();
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    const bool is_point = !std::isnan(distances_m[i]);  // else the point was none: it stays NaN
    if (statuses[i] == FieldStatus::kKnown || !is_point) continue;
    if (statuses[i] == FieldStatus::kUnknown) {
      if (policy.unknown == Space::kOccupied && distances_m[i] > 0.0) distances_m[i] = 0.0;
    } else if (policy.outside == Space::kFree) {
      distances_m[i] = std::numeric_limits<double>::infinity();
      set_gradient(gradients, i, Eigen::Vector3d::Zero());
    } else {
      const Eigen::Vector3d inwards = points_m[i].cwiseMax(lower_m).cwiseMin(upper_m) - points_m[i];
      const double outside_m = inwards.norm();
      distances_m[i] = -outside_m;
      set_gradient(
          gradients, i,
          outside_m > 0.0 ? Eigen::Vector3d(inwards / outside_m) : Eigen::Vector3d::Zero());
    }
  }
}

}  // namespace sidestep
