#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <sidestep/core/export.hpp>
#include <sidestep/geometry/grid.hpp>

namespace sidestep {

/// kBlockSide_vox^3 voxels of a truncated signed distance map, x fastest, then y.
struct TsdfBlock {
  static constexpr int kVoxels = kBlockSide_vox * kBlockSide_vox * kBlockSide_vox;
  /// Metres from the voxel's centre to the surface along the rays that saw it; negative behind
  /// the surface; cut off at the truncation distance both ways.
  alignas(64) std::array<float, kVoxels> distance_m;
  /// How much was measured; 0: never observed, and the distance means nothing.
  alignas(64) std::array<float, kVoxels> weight;
};

/// A view that a Mapper may offer (dynamic_cast from it): truncated signed distances by block.
/// Valid until the next integrate(). [mapping]
class SIDESTEP_EXPORT TsdfView {
 public:
  static constexpr const char* kViewName = "tsdf";

  virtual ~TsdfView() = default;
  /// The mapper's grid(), in whose block_linear order the blocks are numbered. Constant.
  [[nodiscard]] virtual const GridSpec& tsdf_grid() const noexcept = 0;
  /// Distances are cut off here. Constant.
  [[nodiscard]] virtual double truncation_m() const noexcept = 0;
  /// Null where no voxel of the block was ever observed. Voxels beyond the grid have weight 0.
  [[nodiscard]] virtual const TsdfBlock* tsdf_block(std::int32_t block) const noexcept = 0;
  /// The blocks in which the newest integrate() changed a distance or observed a voxel for the
  /// first time; ascending, without repetition. More than MapUpdate::changed_blocks, which
  /// names those that changed between occupied, free and unknown.
  [[nodiscard]] virtual std::span<const std::int32_t> tsdf_changed_blocks() const noexcept = 0;
};

}  // namespace sidestep
