#include <sidestep/field/distance_field.hpp>

#include <algorithm>
#include <array>

namespace sidestep {

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

}  // namespace sidestep
