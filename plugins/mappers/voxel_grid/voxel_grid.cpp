#include "voxel_grid.hpp"

#include <cmath>

#include <sidestep/mapping/frame_check.hpp>

namespace sidestep::voxel_grid {
namespace {

LogOdds model_of(const VoxelGridOptions& options) {
  const auto fixed = [](double log_odds) {
    return static_cast<std::int16_t>(std::lround(log_odds * LogOdds::kUnits));
  };
  return {fixed(options.l_hit), fixed(options.l_miss), fixed(options.l_min), fixed(options.l_max),
          fixed(options.occupied_at)};
}

}  // namespace

VoxelGrid::VoxelGrid(const VoxelGridOptions& options, const HostContext& context)
    : options_(options),
      workers_(context.workers),
      map_(options.grid(), model_of(options)),
      hits_(options.grid()),
      self_(context.robot, options.self_filter_margin_m),
      projective_(options, map_, hits_, context.workers) {}

Result<MapUpdate> VoxelGrid::integrate(const Frame& frame) {
  if (auto ok = check_frame(frame); !ok) return tl::make_unexpected(std::move(ok.error()));
  const auto* image = std::get_if<DepthImage>(&frame.measurement);
  if (image == nullptr && options_.method == "projective") {
    return fail(ErrorCode::kUnsupported, "method projective needs depth images, not point clouds",
                "frame " + std::to_string(frame.sequence), "set method to auto or raycast");
  }
  if (auto ok = self_.pose(frame); !ok) return tl::make_unexpected(std::move(ok.error()));

  MapUpdate update;
  if (image != nullptr && options_.method != "raycast") {
    update.counts = projective_.integrate(frame, *image, self_);
  } else {
    if (!raycast_) raycast_.emplace(options_, map_, hits_, workers_);
    update.counts = raycast_->integrate(frame, self_);
  }
  update.sequence = ++sequence_;
  update.stamp = frame.stamp;
  update.changed_blocks = map_.take_changed_blocks();
  return update;
}

Result<std::unique_ptr<Mapper>> create(const VoxelGridOptions& options,
                                       const HostContext& context) {
  if (auto ok = check_options(options); !ok) return tl::make_unexpected(std::move(ok.error()));
  return std::make_unique<VoxelGrid>(options, context);
}

}  // namespace sidestep::voxel_grid
