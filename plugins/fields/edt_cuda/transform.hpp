#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include <sidestep/core/error.hpp>

#include "cuda/host_backend.hpp"
#include "cuda/occupancy_on_device.hpp"

namespace sidestep::edt_cuda {

struct TransformSettings {
  cuda::Extent size_vox;
  /// Squared distances, in voxels, are cut off here.
  std::uint32_t cap = 0;
  bool is_signed = false;
};

/// The blocks in which distances changed, ascending, and their values one block after the other, x
/// fastest, 0 beyond the grid: squared distances in voxels, positive to the nearest obstacle and,
/// of a signed transform, negative to the nearest free voxel. Of the two kinds of values one is
/// empty: 16 bits where the cap fits them, else 32.
struct ChangedDistances {
  std::span<const std::int32_t> blocks;
  std::span<const std::int16_t> near_vox2;
  std::span<const std::int32_t> far_vox2;
};

/// The exact squared Euclidean distance of every voxel of a grid to the nearest obstacle, kept up
/// to date as obstacles change, of which the host sees what changed. For one thread at a time.
class DistanceTransform {
 public:
  /// The farthest distance, squared, of which 16 bits hold both signs.
  static constexpr std::uint32_t kLargestNearCap = 32767;
  /// The farthest of all, 8192 voxels: whoever wants metres looks them up in a table of so many.
  static constexpr std::uint32_t kLargestCap = 1u << 26;

  virtual ~DistanceTransform() = default;

  /// Room for the obstacles of that many blocks: rows as occupancy_on_device.hpp has them, one
  /// block after the other. Valid until the next call of anything.
  [[nodiscard]] virtual Result<std::span<std::uint16_t>> obstacle_rows(std::size_t blocks) = 0;

  /// Takes over the rows that obstacle_rows() was filled with, those of `changed_blocks`: all at
  /// first, then those that may have changed. What it returns is valid until the next call. Fails
  /// where the device does; the transform is then of no more use.
  [[nodiscard]] virtual Result<ChangedDistances> update(
      std::span<const std::int32_t> changed_blocks) = 0;

  /// The same, from a map on this device.
  [[nodiscard]] virtual Result<ChangedDistances> update(
      std::span<const std::int32_t> changed_blocks, const cuda::OccupancyOnDevice& map,
      bool unknown_is_occupied) = 0;

  /// Of the device whose maps update() can read.
  [[nodiscard]] virtual int ordinal() const noexcept = 0;
  /// How long the stages of the newest update took.
  [[nodiscard]] virtual const cuda::StageTimes& times() const noexcept = 0;
};

/// A way to make a transform.
using MakeTransform =
    std::function<Result<std::unique_ptr<DistanceTransform>>(const TransformSettings&)>;

/// One that runs on a CUDA device. Fails with kPlugin where it cannot be used, kUnsupported where
/// the grid is too large for it.
[[nodiscard]] Result<std::unique_ptr<DistanceTransform>> make_device_transform(
    const TransformSettings& settings, int ordinal);

/// One whose kernels run on the host, one thread after the other, for tests.
[[nodiscard]] Result<std::unique_ptr<DistanceTransform>> make_host_transform(
    const TransformSettings& settings, cuda::HostBackend backend);

}  // namespace sidestep::edt_cuda
