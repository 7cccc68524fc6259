#pragma once

#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/ray_ends.hpp>

#include "block_scratch.hpp"
#include "options.hpp"
#include "ray.hpp"

namespace sidestep::tsdf {

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

}  // namespace sidestep::tsdf
