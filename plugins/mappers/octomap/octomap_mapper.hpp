#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <octomap/octomap.h>

#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/octree_view.hpp>
#include <sidestep/mapping/ray_ends.hpp>
#include <sidestep/plugin/map_options.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::octomap_mapper {

/// The sensor model's defaults are OctoMap's own (Hornung 2013, Sec. 3.2).
struct OctomapOptions : MapOptions {
  OctomapOptions() {
    resolution_m = 0.05;
    size_vox = {160, 160, 64};
  }

  double prob_hit = 0.7;
  double prob_miss = 0.4;
  double clamp_min = 0.1192;
  double clamp_max = 0.971;
  double occupied_at = 0.5;

  static Parameters<OctomapOptions> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

/// OctoMap, bounded by a grid, and the same occupancy as bits on that grid.
class OctomapMapper final : public Mapper, public OccupancyView, public OctreeView {
 public:
  /// options.check() must find nothing wrong.
  OctomapMapper(const OctomapOptions& options, const HostContext& context);

  [[nodiscard]] Result<MapUpdate> integrate(const Frame& frame) override;
  [[nodiscard]] const GridSpec& grid() const noexcept override { return grid_; }

  [[nodiscard]] const GridSpec& occupancy_grid() const noexcept override { return grid_; }
  [[nodiscard]] VoxelBits occupied() const noexcept override { return {occupied_, words_per_row_}; }
  [[nodiscard]] VoxelBits known() const noexcept override { return {known_, words_per_row_}; }

  [[nodiscard]] octomap::OcTree& octree() noexcept override { return tree_; }

 private:
  [[nodiscard]] octomap::point3d centre(const Eigen::Vector3i& voxel) const;
  IntegrationCounts insert(const Frame& frame);
  void update_nodes(const octomap::Pointcloud& hits, const octomap::Pointcloud& free_ends,
                    const octomap::point3d& camera);
  [[nodiscard]] std::vector<std::int32_t> apply_changes();

  GridSpec grid_;
  PointRules rules_;
  bool clear_no_return_;
  SelfFilter self_;
  octomap::OcTree tree_;
  octomap::OcTreeKey first_key_;  ///< Of voxel (0, 0, 0).
  int words_per_row_;
  std::vector<std::uint64_t> occupied_;
  std::vector<std::uint64_t> known_;
  std::int64_t sequence_ = 0;
};

[[nodiscard]] Result<std::unique_ptr<Mapper>> create(const OctomapOptions& options,
                                                     const HostContext& context);

}  // namespace sidestep::octomap_mapper
