#pragma once

#include <memory>
#include <optional>

#include "integrators.hpp"

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
  bool recentre(const Eigen::Vector3d& camera_m);
  /// Brings a part of the map to the time of a frame that has been integrated. Log-odds fade
  /// exponentially towards 0, and a voxel whose log-odds have come near to 0 is unknown again. A
  /// block counts as seen where a frame changed, or confirmed, any of its voxels. Each call looks
  /// at a sixteenth of the blocks, so that no frame has to fade all of a map.
  void fade(double now_s);

  VoxelGridOptions options_;
  WorkerPool& workers_;
  LogOddsGrid map_;
  VoxelMarks hits_;
  SelfFilter self_;
  ProjectiveIntegrator projective_;
  std::optional<RaycastIntegrator> raycast_;  // made when first needed: it has a memory of its own
  std::optional<Eigen::Vector2d> window_;  // where the camera was when the grid lay where it does
  int fade_turn_ = 0;
  std::int64_t sequence_ = 0;
};

[[nodiscard]] Result<std::unique_ptr<Mapper>> create(const VoxelGridOptions& options,
                                                     const HostContext& context);

}  // namespace sidestep::voxel_grid
