#pragma once

#include <memory>
#include <vector>

#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/self_filter.hpp>
#include <sidestep/mapping/tsdf_view.hpp>

#include "tsdf_map.hpp"

namespace sidestep::tsdf {

/// Truncated signed distances in blocks (Oleynikova et al. 2017, Voxblox).
class TsdfMapper final : public Mapper, public TsdfView, public OccupancyView {
 public:
  /// options.check() must find nothing wrong.
  TsdfMapper(const TsdfOptions& options, const HostContext& context);

  [[nodiscard]] Result<MapUpdate> integrate(const Frame& frame) override;
  [[nodiscard]] const GridSpec& grid() const noexcept override { return map_.grid(); }

  [[nodiscard]] const GridSpec& tsdf_grid() const noexcept override { return map_.grid(); }
  [[nodiscard]] double truncation_m() const noexcept override { return map_.truncation_m(); }
  [[nodiscard]] const TsdfBlock* tsdf_block(std::int32_t block) const noexcept override {
    return map_.block(block);
  }
  [[nodiscard]] std::span<const std::int32_t> tsdf_changed_blocks() const noexcept override {
    return changed_;
  }

  [[nodiscard]] const GridSpec& occupancy_grid() const noexcept override { return map_.grid(); }
  [[nodiscard]] VoxelBits occupied() const noexcept override { return map_.occupied(); }
  [[nodiscard]] VoxelBits known() const noexcept override { return map_.known(); }

 private:
  /// Divides measurements [begin, end) into parts and calls make(from, to, part, counts) for all
  /// of them at once.
  template <class Make>
  IntegrationCounts in_parts(std::size_t begin, std::size_t end, const Make& make);
  /// One ray for each measurement of [begin, end) that says anything.
  IntegrationCounts make_all_rays(const RayMaker& maker, std::size_t begin, std::size_t end);
  IntegrationCounts integrate_fast(const RayEnds& ends, const RayMaker& maker);
  IntegrationCounts integrate_simple(const RayEnds& ends, const RayMaker& maker);
  IntegrationCounts integrate_merged(const RayEnds& ends, const RayMaker& maker);
  void walk_and_integrate(const Eigen::Vector3d& camera_vox);

  TsdfOptions options_;
  PointRules rules_;
  WorkerPool& workers_;
  SelfFilter self_;
  TsdfMap map_;
  RayBundler bundler_;
  std::vector<Trace> traces_;       ///< One for each part of a frame.
  std::vector<RayWalker> walkers_;  ///< As many.
  std::vector<StartCells> starts_;  ///< As many for the fast integrator, else none.
  std::vector<std::int32_t> changed_;
  std::int64_t sequence_ = 0;
};

[[nodiscard]] Result<std::unique_ptr<Mapper>> create(const TsdfOptions& options,
                                                     const HostContext& context);

}  // namespace sidestep::tsdf
