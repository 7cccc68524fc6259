#include "voxel_grid.hpp"

#include <sidestep/mapping/frame_check.hpp>

namespace sidestep::voxel_grid {

VoxelGrid::VoxelGrid(const VoxelGridOptions& options, const HostContext& context)
    : options_(options),
      workers_(context.workers),
      map_(options.grid(), log_odds_of(options)),
      hits_(options.grid()),
      self_(context.robot, options.self_filter_margin_m),
      projective_(options, map_, hits_, context.workers) {
  if (options.fade_half_life_s > 0.0) {
    fader_.emplace(options.fade_half_life_s, map_, context.workers);
  }
}

bool VoxelGrid::follow(const Eigen::Vector3d& camera_m) {
  if (!window_) window_ = camera_m.head<2>();
  const double block_m = map_.spec().resolution_m * kBlockSide_vox;
  const Eigen::Vector2i blocks = ((camera_m.head<2>() - *window_) / block_m).cast<int>();
  if (blocks.isZero()) return false;
  map_.move(blocks);
  *window_ += blocks.cast<double>() * block_m;
  return true;
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
  update.grid_moved = options_.sliding_window && follow(frame.T_world_camera.translation());
  if (image != nullptr && options_.method != "raycast") {
    update.counts = projective_.integrate(frame, *image, self_);
  } else {
    if (!raycast_) raycast_.emplace(options_, map_, hits_, workers_);
    update.counts = raycast_->integrate(frame, self_);
  }
  if (fader_) fader_->fade(frame.stamp);
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
