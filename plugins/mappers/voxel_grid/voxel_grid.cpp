#include "voxel_grid.hpp"

#include <cmath>

#include <sidestep/mapping/frame_check.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::voxel_grid {

VoxelGrid::VoxelGrid(const VoxelGridOptions& options, const HostContext& context)
    : options_(options),
      workers_(context.workers),
      map_(options.grid(), log_odds_of(options)),
      hits_(options.grid()),
      self_(context.robot, options.self_filter_margin_m),
      projective_(options, map_, hits_, context.workers) {}

bool VoxelGrid::recentre(const Eigen::Vector3d& camera_m) {
  if (!window_) window_ = camera_m.head<2>();
  const double block_m = map_.spec().resolution_m * kBlockSide_vox;
  const Eigen::Vector2i blocks = ((camera_m.head<2>() - *window_) / block_m).cast<int>();
  if (blocks.isZero()) return false;
  map_.move(blocks);
  *window_ += blocks.cast<double>() * block_m;
  return true;
}

void VoxelGrid::fade(double now_s) {
  constexpr int kTurns = 16;
  // Voxels are scaled this often in a half-life, so that integers hold the steps.
  constexpr double kStepsPerHalfLife = 8.0;
  // A probability between 0.475 and 0.525 says nothing.
  constexpr double kForgetBelow = 0.1;
  const double half_life_s = options_.fade_half_life_s;
  const int turn = fade_turn_;
  fade_turn_ = (fade_turn_ + 1) % kTurns;
  for_each_block(map_, workers_, [&](int row, const Eigen::Vector3i& block) {
    if (row % kTurns != turn) return;
    const std::int32_t linear = block_linear(block, map_.counts());
    const double unseen_s = now_s - map_.last_update_s(linear);
    if (unseen_s * kStepsPerHalfLife < half_life_s) return;
    map_.last_update_s(linear) = now_s;
    const Fading fading{static_cast<std::int32_t>(std::exp2(-unseen_s / half_life_s) * (1 << 15)),
                        static_cast<std::int16_t>(kForgetBelow * LogOdds::kUnits)};
    note(map_, block, now_s, voxel_grid::fade(map_.model(), block_rows(map_, block), fading));
  });
}

Result<MapUpdate> VoxelGrid::integrate(const Frame& frame) {
  SIDESTEP_TRY(check_frame(frame));
  const auto* image = std::get_if<DepthImage>(&frame.measurement);
  if (image == nullptr && options_.method == "projective") {
    return fail(ErrorCode::kUnsupported, "method projective needs depth images, not point clouds",
                "frame " + std::to_string(frame.sequence), "set method to auto or raycast");
  }
  SIDESTEP_TRY(self_.pose(frame));

  MapUpdate update;
  update.grid_moved = options_.sliding_window && recentre(frame.T_world_camera.translation());
  if (image != nullptr && options_.method != "raycast") {
    update.counts = projective_.integrate(frame, *image, self_);
  } else {
    if (!raycast_) raycast_.emplace(options_, map_, hits_, workers_);
    update.counts = raycast_->integrate(frame, self_);
  }
  if (options_.fade_half_life_s > 0.0) fade(frame.stamp.seconds());
  update.sequence = ++sequence_;
  update.stamp = frame.stamp;
  update.changed_blocks = map_.take_changed_blocks();
  return update;
}

Result<std::unique_ptr<Mapper>> create(const VoxelGridOptions& options,
                                       const HostContext& context) {
  return std::make_unique<VoxelGrid>(options, context);
}

}  // namespace sidestep::voxel_grid

SIDESTEP_PLUGIN(sidestep::Mapper, sidestep::voxel_grid::VoxelGridOptions,
                sidestep::voxel_grid::create, "voxel_grid", "0.1.0",
                "Log-odds occupancy on a dense grid, projective for images, ray cast for clouds",
                sidestep::OccupancyView)
