#include "neighbours.hpp"

#include <cmath>

namespace sidestep::esdf {
namespace {

/// Which third of an axis a coordinate belongs to: the low end, between, the high end.
constexpr int end_of(int coordinate) {
  return coordinate == 0 ? 0 : (coordinate == kBlockSide_vox - 1 ? 2 : 1);
}

}  // namespace

Neighbours::Neighbours(const Eigen::Vector3i& blocks, double resolution_m) {
  std::size_t count = 0;
  for (int code = 0; code < 27; ++code) {
    const Eigen::Vector3i direction(code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1);
    if (direction.isZero()) continue;
    directions_[count] = direction;
    steps_m_[count] =
        static_cast<float>(resolution_m * std::sqrt(static_cast<double>(direction.squaredNorm())));
    ++count;
  }
  const int voxel_stride[3] = {1, kBlockSide_vox, kBlockSide_vox * kBlockSide_vox};
  const int block_stride[3] = {static_cast<int>(kVoxelsPerBlock),
                               static_cast<int>(kVoxelsPerBlock) * blocks.x(),
                               static_cast<int>(kVoxelsPerBlock) * blocks.x() * blocks.y()};
  for (int place = 0; place < kPlaces; ++place) {
    const int ends[3] = {place % 3, place / 3 % 3, place / 9};
    for (std::size_t d = 0; d < kCount; ++d) {
      std::int32_t offset = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const int step = directions_[d][axis];
        const bool leaves = (step < 0 && ends[axis] == 0) || (step > 0 && ends[axis] == 2);
        offset += step * (leaves ? block_stride[axis] - (kBlockSide_vox - 1) * voxel_stride[axis]
                                 : voxel_stride[axis]);
      }
      offsets_[static_cast<std::size_t>(place)][d] = offset;
    }
  }
  for (int v = 0; v < static_cast<int>(kVoxelsPerBlock); ++v) {
    place_[static_cast<std::size_t>(v)] = static_cast<std::uint8_t>(
        end_of(v % kBlockSide_vox) + 3 * (end_of(v / kBlockSide_vox % kBlockSide_vox) +
                                          3 * end_of(v / (kBlockSide_vox * kBlockSide_vox))));
  }
}

}  // namespace sidestep::esdf
