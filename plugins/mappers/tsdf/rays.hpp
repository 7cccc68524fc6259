#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/ray_ends.hpp>
#include <sidestep/plugin/map_options.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::tsdf {

struct TsdfOptions : MapOptions {
  std::string integrator = "fast";
  double truncation_vox = 4.0;
  std::string weighting = "inverse_square";
  bool weight_dropoff = true;
  double max_weight = 10000.0;
  bool carving = true;
  int start_cells_per_voxel = 2;
  int max_consecutive_collisions = 2;

  static Parameters<TsdfOptions> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

/// Values of one frame by block, for the blocks that the frame touches; a value before its
/// first use is `empty`. Keeps its memory from frame to frame.
template <class Value>
class BlockScratch {
 public:
  BlockScratch(std::size_t block_count, std::size_t values_per_block, Value empty)
      : slots_(block_count, kNone), per_block_(values_per_block), empty_(empty) {}

  /// The values of a block, until the next call.
  [[nodiscard]] Value* block(std::int32_t block) {
    std::int32_t& slot = slots_[static_cast<std::size_t>(block)];
    if (slot == kNone) {
      slot = static_cast<std::int32_t>(touched_.size());
      touched_.push_back(block);
      const std::size_t needed = touched_.size() * per_block_;
      if (values_.size() < needed) values_.resize(std::max(needed, values_.size() * 2));
      std::fill_n(values_.data() + needed - per_block_, per_block_, empty_);
    }
    return values_.data() + static_cast<std::size_t>(slot) * per_block_;
  }

  void clear() noexcept {
    for (const std::int32_t block : touched_) slots_[static_cast<std::size_t>(block)] = kNone;
    touched_.clear();
  }

 private:
  static constexpr std::int32_t kNone = -1;
  std::vector<std::int32_t> slots_;
  std::vector<std::int32_t> touched_;
  std::vector<Value> values_;
  std::size_t per_block_;
  Value empty_;
};

/// One ray to integrate; positions in voxels from the grid's lower corner.
struct Ray {
  Eigen::Vector3d end_vox;
  Eigen::Vector3d direction;  ///< Unit vector from the camera to the end.
  double length_vox = 0.0;    ///< From the camera to the end.
  float weight = 0.0F;
  bool hit = false;  ///< Whether the end is a surface, else it is free.
};

/// The voxels in which a ray crosses one block.
struct Segment {
  std::int32_t block;
  std::uint32_t ray;    ///< Index into the trace's rays.
  std::uint32_t first;  ///< Index into the trace's voxels.
  std::uint32_t count;
};

/// A share of a frame's rays, and the voxels that they cross.
struct Trace {
  std::vector<Ray> rays;
  std::vector<Segment> segments;
  std::vector<std::uint16_t> voxels;  ///< Within their block: x + 16 (y + 16 z).

  void clear() noexcept {
    rays.clear();
    segments.clear();
    voxels.clear();
  }
};

/// A voxel's index within its block.
[[nodiscard]] inline int index_in_block(const Eigen::Vector3i& voxel) noexcept {
  constexpr int kMask = kBlockSide_vox - 1;
  return (voxel.x() & kMask) +
         kBlockSide_vox * ((voxel.y() & kMask) + kBlockSide_vox * (voxel.z() & kMask));
}

/// Makes the rays of one measurement, weighted.
class RayMaker {
 public:
  RayMaker(const TsdfOptions& options, const RayEnds& ends, const Frame& frame);

  /// What measurement `index` says; nothing where it says nothing about the grid. [any]
  [[nodiscard]] std::optional<RayEnd> end(std::size_t index, IntegrationCounts& counts) const {
    return ends_.at(index, counts);
  }

  /// A ray to a point; its direction, length and weight follow. Nothing at the camera itself.
  [[nodiscard]] std::optional<Ray> to(const RayEnd& end) const;

 private:
  const RayEnds& ends_;
  Eigen::Vector3d camera_vox_;
  Eigen::Vector3d optical_axis_;  ///< World frame.
  double resolution_m_;
  bool inverse_square_;
};

/// The points of a frame that fall into the same voxel, as one ray to their weighted mean that
/// carries their weights (Oleynikova et al. 2017, Sec. IV). Of free ends, the first one.
class RayBundler {
 public:
  explicit RayBundler(const GridSpec& grid);

  void add(const Ray& ray);
  /// The bundles in the order of their first points, which leave.
  [[nodiscard]] std::vector<Ray> take(const RayMaker& maker);

 private:
  struct Bundle {
    Eigen::Vector3d weighted_sum_vox = Eigen::Vector3d::Zero();
    double weight = 0.0;
    bool hit = false;
  };
  GridSpec grid_;
  Eigen::Vector3i counts_;
  BlockScratch<std::int32_t> hits_;  ///< Index of the voxel's bundle.
  BlockScratch<std::int32_t> free_;
  std::vector<Bundle> bundles_;
};

/// Cells finer than voxels in which a ray has ended. One for each thread.
class StartCells {
 public:
  explicit StartCells(const TsdfOptions& options);
  /// Whether the end's cell is new; it is not afterwards. Free and hit ends count apart.
  [[nodiscard]] bool insert(const RayEnd& end);
  void clear() noexcept;

 private:
  Eigen::Vector3i size_cells_;
  Eigen::Vector3i counts_;
  int per_voxel_;
  BlockScratch<std::uint64_t> hits_;
  BlockScratch<std::uint64_t> free_;
};

/// Lists the voxels that rays cross (Amanatides and Woo 1987), from behind the surface towards
/// the camera. One for each thread; keeps scratch memory.
class RayWalker {
 public:
  explicit RayWalker(const TsdfOptions& options);

  /// Appends the segments of all rays of a trace. With the fast integrator a ray stops where,
  /// between its end and the camera, it meets too many voxels in a row that rays of this trace
  /// have seen before.
  void walk_all(const Eigen::Vector3d& camera_vox, Trace& trace);

 private:
  /// A walk from voxel to voxel, both in the grid.
  struct Course {
    Eigen::Vector3i voxel;
    Eigen::Vector3i last;
    Eigen::Vector3d from_vox;   ///< Where the ray begins, maybe outside the grid.
    Eigen::Vector3d along_vox;  ///< From there to where it ends.
    int steps_to_end = 0;       ///< Until it has passed the surface.
  };
  [[nodiscard]] std::optional<Course> course(const Eigen::Vector3d& camera_vox,
                                             const Ray& ray) const;
  template <bool kStopsEarly>
  void walk(const Course& course, std::uint32_t ray, Trace& trace);

  GridSpec grid_;
  Eigen::Vector3i counts_;
  double truncation_vox_;
  bool carving_;
  bool stops_early_;
  int max_collisions_;
  BlockScratch<std::uint64_t> seen_;  ///< A bit for each voxel.
};

}  // namespace sidestep::tsdf
