#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <sidestep/core/error.hpp>

#include "cuda/host_backend.hpp"
#include "cuda/occupancy_on_device.hpp"
#include "image_kernels.hpp"
#include "ray_kernels.hpp"

namespace sidestep::voxel_grid_cuda {

/// A depth image and where it was taken, as the kernels of image_kernels.hpp want it.
struct ImageFrame {
  std::span<const float> depth_m;
  View view;
  PixelRules rules;
  float x_first = 0.0F;
  float x_step = 0.0F;
  float start_vox[3] = {};
  float across_vox[3] = {};
  std::span<const PixelLine> lines;  ///< One a row.
  std::span<const Ball> balls;
};

/// Measurements whose rays are cast: a cloud, or else an image.
struct RayFrame {
  std::span<const CloudPoint> cloud;
  std::span<const float> depth_m;
  int width_px = 0;
  double fx_px = 0.0, fy_px = 0.0, cx_px = 0.0, cy_px = 0.0;
  PointLimits limits;
  double T_world_camera[3][4] = {};
  Point origin_m;
  Point camera_vox;
  double resolution_m = 0.0;
  std::span<const WorldBall> balls;
  Point balls_lower_m, balls_upper_m;
};

/// What one frame changed: the blocks in which a voxel became occupied, free or known, ascending,
/// and the rows of each, first of occupied and then of known, as occupancy_on_device.hpp has them.
struct MapChange {
  std::span<const std::int32_t> blocks;
  std::span<const std::uint16_t> rows;
  std::array<std::uint32_t, kFates> fates{};
};

struct MapSettings {
  cuda::Extent size_vox;
  Model model;
};

/// Log-odds occupancy on a dense grid, wherever it lies. For one thread at a time; what a call
/// returns is valid until the next. Fails where the device does; the map is then of no more use.
class LogOddsMap {
 public:
  virtual ~LogOddsMap() = default;

  /// Adds a depth image, by looking up for each voxel in view how far the ray of its pixel is free.
  [[nodiscard]] virtual Result<MapChange> integrate(const ImageFrame& frame) = 0;
  /// Adds measurements by walking the voxels along their rays.
  [[nodiscard]] virtual Result<MapChange> integrate(const RayFrame& frame) = 0;

  [[nodiscard]] virtual cuda::OccupancyOnDevice occupancy() const noexcept = 0;
  /// The log-odds of every voxel, block by block, rows of 16; for tests.
  [[nodiscard]] virtual Result<std::vector<std::int16_t>> log_odds() = 0;
  /// How long the stages of the newest frame took.
  [[nodiscard]] virtual const cuda::StageTimes& times() const noexcept = 0;
};

/// A map on a CUDA device. Fails with kPlugin where it cannot be used, kUnsupported where its
/// memory is too small.
[[nodiscard]] Result<std::unique_ptr<LogOddsMap>> make_device_map(const MapSettings& settings,
                                                                  int ordinal);
/// One whose kernels run on the host, one thread after the other, for tests.
[[nodiscard]] Result<std::unique_ptr<LogOddsMap>> make_host_map(const MapSettings& settings,
                                                                cuda::HostBackend backend);

}  // namespace sidestep::voxel_grid_cuda
