#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <sidestep/field/block_table.hpp>
#include <sidestep/field/distance_field.hpp>

namespace sidestep {

/// The distances of kBlockSide_vox^3 voxels in metres, at their centres, x fastest. Shared between
/// snapshots, never changed once published.
struct FieldBlock {
  static constexpr int kVoxels = kBlockSide_vox * kBlockSide_vox * kBlockSide_vox;
  alignas(64) std::array<float, kVoxels> distance_m;
};

/// Which of the same voxels were observed: bit x of row (y, z), rows in order y fastest. Apart from
/// the distances, for as a map grows most voxels become known without a distance changing.
struct KnownBlock {
  std::array<std::uint16_t, kBlockSide_vox * kBlockSide_vox> rows;
};

/// A dense field as tables of shared blocks: a new snapshot shares with the one before whatever did
/// not change.
class SIDESTEP_EXPORT DenseField final : public DistanceField {
 public:
  using Blocks = BlockTable<FieldBlock>;
  using KnownBlocks = BlockTable<KnownBlock>;

  /// Both tables in block_linear order, one entry for each block of info.grid, none null.
  DenseField(FieldInfo info, Blocks blocks, KnownBlocks known);

  void query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
             std::span<Eigen::Vector3d> gradients,
             std::span<FieldStatus> statuses) const noexcept override;
  std::size_t query_below(std::span<const PointFloats> points_m, std::span<const double> limits_m,
                          bool also_unknown,
                          std::span<FieldSample> samples) const noexcept override;

  [[nodiscard]] const Blocks& blocks() const noexcept { return blocks_; }
  [[nodiscard]] const KnownBlocks& known_blocks() const noexcept { return known_; }
  /// The value at one voxel's centre; `voxel` lies inside the grid.
  [[nodiscard]] float at(const Eigen::Vector3i& voxel) const noexcept;
  [[nodiscard]] bool known(const Eigen::Vector3i& voxel) const noexcept;

 private:
  Blocks blocks_;
  KnownBlocks known_;
  Eigen::Vector3i block_counts_;
};

/// A dense field, known everywhere, whose value at each voxel of the grid is distance_m(voxel).
template <class Distance>
[[nodiscard]] std::shared_ptr<const DenseField> make_dense_field(const FieldInfo& info,
                                                                 const Distance& distance_m) {
  const Eigen::Vector3i counts = block_counts(info.grid);
  std::vector<DenseField::Blocks::Entry> blocks;
  for (int b = 0; b < counts.prod(); ++b) {
    const Eigen::Vector3i first =
        kBlockSide_vox *
        Eigen::Vector3i(b % counts.x(), b / counts.x() % counts.y(), b / (counts.x() * counts.y()));
    auto block = std::make_shared<FieldBlock>();
    for (int v = 0; v < FieldBlock::kVoxels; ++v) {
      const Eigen::Vector3i voxel =
          first + Eigen::Vector3i(v % kBlockSide_vox, v / kBlockSide_vox % kBlockSide_vox,
                                  v / (kBlockSide_vox * kBlockSide_vox));
      block->distance_m[static_cast<std::size_t>(v)] =
          info.grid.contains(voxel) ? static_cast<float>(distance_m(voxel)) : 0.0F;
    }
    blocks.push_back(std::move(block));
  }
  const auto all_known = std::make_shared<KnownBlock>();
  all_known->rows.fill(0xffff);
  const std::vector<DenseField::KnownBlocks::Entry> known(blocks.size(), all_known);
  return std::make_shared<const DenseField>(info, blocks, known);
}

}  // namespace sidestep
