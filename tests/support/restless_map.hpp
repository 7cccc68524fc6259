#pragma once

#include <algorithm>
#include <memory>
#include <random>

#include <sidestep/field/dense_field.hpp>
#include <sidestep/mapping/field_builder.hpp>

#include "conformance/grid_map.hpp"

namespace sidestep::testing_support {

/// A map in which boxes of obstacles appear and vanish, most of them across the borders of blocks
/// (16 voxels) and of words and tiles (64) or at the edges of the grid, and parts of which are seen
/// for the first time.
class RestlessMap : public conformance::GridMap {
 public:
  RestlessMap(const GridSpec& grid, unsigned seed) : GridMap(grid), random_(seed) {}

  void step() {
    for (int boxes = below(3); boxes >= 0; --boxes) {
      Eigen::Vector3i low, high;
      for (int axis = 0; axis < 3; ++axis) {
        const int last = grid().size_vox[axis] - 1;
        const int borders[] = {0, 16 * below(last / 16 + 1), 64 * below(last / 64 + 1), last};
        const int middle = below(4) == 0 ? below(last + 1) : borders[below(4)];
        low[axis] = std::max(0, middle - below(3));
        high[axis] = std::min(last, middle + below(3));
      }
      const bool occupied = below(5) < 3;
      for (int z = low.z(); z <= high.z(); ++z) {
        for (int y = low.y(); y <= high.y(); ++y) {
          for (int x = low.x(); x <= high.x(); ++x) set({x, y, z}, occupied);
        }
      }
    }
  }

 private:
  int below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random_); }
  std::mt19937 random_;
};

/// Null where the update fails or the field is not dense.
[[nodiscard]] inline std::shared_ptr<const DenseField> updated(FieldBuilder& builder,
                                                               const MapUpdate& update) {
  const auto field = builder.update(update);
  return field ? std::dynamic_pointer_cast<const DenseField>(*field) : nullptr;
}

}  // namespace sidestep::testing_support
