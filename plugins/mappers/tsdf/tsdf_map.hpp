#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/tsdf_view.hpp>

#include "rays.hpp"

namespace sidestep::tsdf {

/// The blocks of distances, allocated when first touched, and the occupancy that follows.
class TsdfMap {
 public:
  TsdfMap(const TsdfOptions& options, WorkerPool& workers);

  /// Adds the rays of traces, in their order. The result does not depend on the number of
  /// threads: each block is updated by one of them.
  void integrate(std::span<const Trace> traces, const Eigen::Vector3d& camera_vox);

  /// Forgets which blocks changed; to be called before each frame.
  void begin_frame();
  /// Blocks in which occupied or known changed in this frame; ascending.
  [[nodiscard]] std::vector<std::int32_t> changed_occupancy() const;
  /// Blocks in which a distance changed in this frame or a voxel was first seen; ascending.
  [[nodiscard]] std::vector<std::int32_t> changed_distances() const;

  [[nodiscard]] const GridSpec& grid() const noexcept { return grid_; }
  [[nodiscard]] double truncation_m() const noexcept { return static_cast<double>(truncation_m_); }
  [[nodiscard]] const TsdfBlock* block(std::int32_t block) const noexcept {
    return blocks_[static_cast<std::size_t>(block)].get();
  }
  [[nodiscard]] VoxelBits occupied() const noexcept { return {occupied_, words_per_row_}; }
  [[nodiscard]] VoxelBits known() const noexcept { return {known_, words_per_row_}; }

 private:
  /// Where a segment is found.
  struct SegmentRef {
    std::uint32_t trace;
    std::uint32_t segment;
  };
  struct TouchedRows;

  void sort_by_block(std::span<const Trace> traces);
  void integrate_block(std::int32_t block, std::span<const SegmentRef> segments,
                       std::span<const Trace> traces, const Eigen::Vector3d& camera_vox);
  bool integrate_segment(TsdfBlock& out, const Eigen::Vector3d& from_camera_vox, const Ray& ray,
                         std::span<const std::uint16_t> voxels, TouchedRows& touched) const;
  bool refresh_row(const Eigen::Vector3i& block_index, const TsdfBlock& block, int row);

  GridSpec grid_;
  Eigen::Vector3i counts_;
  WorkerPool& workers_;
  float resolution_m_;
  float truncation_m_;
  float max_weight_;
  bool dropoff_;
  std::vector<std::unique_ptr<TsdfBlock>> blocks_;
  int words_per_row_;
  std::vector<std::uint64_t> occupied_, known_;
  std::vector<std::uint8_t> occupancy_changed_, distance_changed_;  // by block, in this frame
  // Scratch of integrate():
  std::vector<std::uint32_t> block_begin_;
  std::vector<std::int32_t> touched_;
  std::vector<SegmentRef> sorted_;
};

}  // namespace sidestep::tsdf
