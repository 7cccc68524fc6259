#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/self_filter.hpp>

#include "log_odds_map.hpp"
#include "voxel_grid.hpp"

namespace sidestep::voxel_grid_cuda {

/// Those of voxel_grid but for a window that moves and for fading.
struct Options : voxel_grid::VoxelGridOptions {
  Options() = default;  // of an aggregate g++ 12 would warn that its base may be uninitialised

  int device = 0;
  std::string fallback = "none";

  static Parameters<Options> parameters();
};

/// A way to make a map.
using MakeMap = std::function<Result<std::unique_ptr<LogOddsMap>>(const MapSettings&)>;

/// Log-odds occupancy on a dense grid in the memory of a CUDA device. The host keeps the bits of
/// occupied and known voxels, of which what changed comes back with every frame.
class VoxelGridCuda final : public Mapper, public OccupancyView, public cuda::DeviceOccupancyView {
 public:
  /// options.check() must find nothing wrong.
  VoxelGridCuda(const Options& options, const HostContext& context,
                std::unique_ptr<LogOddsMap> map);

  /// Where the device fails: with fallback cpu the map begins anew as a voxel_grid, which the
  /// update reports as a grid that has moved.
  [[nodiscard]] Result<MapUpdate> integrate(const Frame& frame) override;
  [[nodiscard]] const GridSpec& grid() const noexcept override { return grid_; }

  [[nodiscard]] const GridSpec& occupancy_grid() const noexcept override { return grid_; }
  [[nodiscard]] VoxelBits occupied() const noexcept override;
  [[nodiscard]] VoxelBits known() const noexcept override;

  [[nodiscard]] std::optional<cuda::OccupancyOnDevice> occupancy_on_device()
      const noexcept override;

  /// The map on the device; null once it has been lost.
  [[nodiscard]] LogOddsMap* map() noexcept { return map_.get(); }

 private:
  [[nodiscard]] Result<MapChange> integrate_image(const Frame& frame, const DepthImage& image);
  [[nodiscard]] Result<MapChange> cast_rays(const Frame& frame);
  [[nodiscard]] Result<MapUpdate> begin_anew(const Frame& frame, const Error& why);
  void take_over(const MapChange& change);

  Options options_;
  HostContext context_;  // a copy: what it refers to outlives this
  GridSpec grid_;
  SelfFilter self_;
  std::unique_ptr<LogOddsMap> map_;
  std::unique_ptr<voxel_grid::VoxelGrid> cpu_;  ///< Once the device has failed.
  int words_per_row_;
  std::vector<std::uint64_t> occupied_, known_;
  std::int64_t sequence_ = 0;
  // Of a frame, kept for their memory.
  std::vector<PixelLine> lines_;
  std::vector<Ball> balls_;
  std::vector<WorldBall> world_balls_;
};

/// A mapper whose map `make` makes; with fallback cpu a voxel_grid where it cannot.
[[nodiscard]] Result<std::unique_ptr<Mapper>> create(const Options& options,
                                                     const HostContext& context,
                                                     const MakeMap& make);

}  // namespace sidestep::voxel_grid_cuda
