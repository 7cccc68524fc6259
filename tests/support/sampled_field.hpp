#pragma once

#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include <sidestep/field/dense_field.hpp>

namespace sidestep::testing_support {

/// A dense field, known everywhere, whose value at each voxel's centre is distance(centre), which
/// nowhere changes by more than the way.
template <class Distance>
[[nodiscard]] std::shared_ptr<const DenseField> sampled_field(const GridSpec& grid,
                                                              Distance distance) {
  const FieldInfo info{.grid = grid,
                       .is_signed = true,
                       .max_distance_m = std::numeric_limits<double>::infinity(),
                       .lipschitz = 1.0};
  return make_dense_field(
      info, [&](const Eigen::Vector3i& voxel) { return distance(grid.centre_m(voxel)); });
}

}  // namespace sidestep::testing_support
