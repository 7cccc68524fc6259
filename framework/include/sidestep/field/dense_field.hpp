#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <sidestep/field/distance_field.hpp>

namespace sidestep {

/// kBlockSide_vox^3 voxels of a field: distances in metres at voxel centres, x fastest, and
/// one bit a voxel that says whether it was observed. Shared between snapshots, never changed
/// once published.
struct FieldBlock {
  static constexpr int kVoxels = kBlockSide_vox * kBlockSide_vox * kBlockSide_vox;
  alignas(64) std::array<float, kVoxels> distance_m;
  /// Bit x of row (y, z), rows in order y fastest.
  alignas(64) std::array<std::uint16_t, kBlockSide_vox * kBlockSide_vox> known;
};

/// A dense field as a table of shared blocks: a new snapshot copies the table (25 kB for 320
/// x 320 x 128 voxels) and replaces what has changed.
class SIDESTEP_EXPORT DenseField final : public DistanceField {
 public:
  using BlockTable = std::vector<std::shared_ptr<const FieldBlock>>;

  /// `blocks` in block_linear order, one for each block of info.grid, none null.
  DenseField(FieldInfo info, BlockTable blocks);

  void query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
             std::span<Eigen::Vector3d> gradients,
             std::span<FieldStatus> statuses) const noexcept override;

  [[nodiscard]] const BlockTable& blocks() const noexcept { return blocks_; }
  /// The value at one voxel's centre; `voxel` lies inside the grid.
  [[nodiscard]] float at(const Eigen::Vector3i& voxel) const noexcept;
  [[nodiscard]] bool known(const Eigen::Vector3i& voxel) const noexcept;

 private:
  BlockTable blocks_;
  Eigen::Vector3i block_counts_;
};

}  // namespace sidestep
