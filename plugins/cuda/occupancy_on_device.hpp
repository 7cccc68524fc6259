#pragma once

#include <cstdint>
#include <optional>

#include <sidestep/core/export.hpp>

namespace sidestep::cuda {

/// Voxels of a block of 16^3 along x, as bits: what a map holds on the device is rows of these,
/// block by block in block_linear order, row (y, z) of a block at y + 16 * z. Bits beyond the
/// grid are 0.
inline constexpr int kBlockSide = 16;
inline constexpr int kBlockRows = kBlockSide * kBlockSide;
inline constexpr int kBlockVoxels = kBlockRows * kBlockSide;

/// A map's occupancy where it lies.
struct OccupancyOnDevice {
  const std::uint16_t* occupied = nullptr;
  const std::uint16_t* known = nullptr;
  int ordinal = 0;  ///< Number of the device.
};

/// A view that a Mapper may offer besides its OccupancyView (dynamic_cast from it): the same
/// occupancy in the memory of a CUDA device, complete whenever integrate() has returned. Valid
/// until the next integrate(). [mapping]
class SIDESTEP_EXPORT DeviceOccupancyView {
 public:
  virtual ~DeviceOccupancyView() = default;
  /// Nothing where the map does not lie on a device after all.
  [[nodiscard]] virtual std::optional<OccupancyOnDevice> occupancy_on_device() const noexcept = 0;
};

}  // namespace sidestep::cuda
