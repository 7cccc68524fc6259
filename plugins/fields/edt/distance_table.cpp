#include "distance_table.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep::edt {

std::uint32_t cap_vox2(double max_distance_m, const GridSpec& grid) {
  const double diagonal2 = grid.size_vox.cast<double>().squaredNorm();
  if (max_distance_m <= 0.0) return static_cast<std::uint32_t>(diagonal2);
  const double limit = max_distance_m / grid.resolution_m;
  const double cap = std::ceil(limit * limit * (1.0 - 1e-12));
  return static_cast<std::uint32_t>(std::clamp(cap, 1.0, diagonal2));
}

std::vector<float> distance_table(double resolution_m, std::uint32_t cap, double max_distance_m) {
  std::vector<float> table_m(cap + std::size_t{1});
  for (std::size_t d2 = 0; d2 < table_m.size(); ++d2) {
    table_m[d2] = static_cast<float>(resolution_m * std::sqrt(static_cast<double>(d2)));
  }
  if (std::isfinite(max_distance_m)) table_m[cap] = static_cast<float>(max_distance_m);
  return table_m;
}

}  // namespace sidestep::edt
