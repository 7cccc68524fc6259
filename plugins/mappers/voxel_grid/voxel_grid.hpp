#pragma once

#include <memory>
#include <optional>

#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/self_filter.hpp>

#include "log_odds_grid.hpp"
#include "options.hpp"
#include "projective.hpp"
#include "raycast.hpp"
#include "voxel_fader.hpp"
#include "voxel_marks.hpp"

namespace sidestep::voxel_grid {

/// Log-odds occupancy on a dense grid.
class VoxelGrid final : public Mapper, public OccupancyView {
 public:
  /// options.check() must find nothing wrong.
  VoxelGrid(const VoxelGridOptions& options, const HostContext& context);

  [[nodiscard]] Result<MapUpdate> integrate(const Frame& frame) override;
  [[nodiscard]] const GridSpec& grid() const noexcept override { return map_.spec(); }

  [[nodiscard]] const GridSpec& occupancy_grid() const noexcept override { return map_.spec(); }
  [[nodiscard]] VoxelBits occupied() const noexcept override { return map_.occupied(); }
  [[nodiscard]] VoxelBits known() const noexcept override { return map_.known(); }

  [[nodiscard]] double log_odds(const Eigen::Vector3i& voxel) const { return map_.log_odds(voxel); }

 private:
  /// Moves the grid after the camera; returns whether it had to.
  bool follow(const Eigen::Vector3d& camera_m);

  VoxelGridOptions options_;
  WorkerPool& workers_;
  LogOddsGrid map_;
  VoxelMarks hits_;
  SelfFilter self_;
  ProjectiveIntegrator projective_;
  std::optional<RaycastIntegrator> raycast_;  // made when first needed: it has a memory of its own
  std::optional<VoxelFader> fader_;           // where anything fades
  std::optional<Eigen::Vector2d> window_;  // where the camera was when the grid lay where it does
  std::int64_t sequence_ = 0;
};

[[nodiscard]] Result<std::unique_ptr<Mapper>> create(const VoxelGridOptions& options,
                                                     const HostContext& context);

}  // namespace sidestep::voxel_grid
