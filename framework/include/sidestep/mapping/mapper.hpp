#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/geometry/grid.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// Counts of a frame's points by outcome.
struct IntegrationCounts {
  std::int64_t points = 0;        ///< Valid measurements.
  std::int64_t inserted = 0;      ///< Marked a voxel of the grid as hit.
  std::int64_t floor = 0;         ///< Cleared along the ray, not inserted (floor rule).
  std::int64_t self = 0;          ///< The robot's own, removed.
  std::int64_t out_of_range = 0;  ///< Beyond the maximum range; the ray clears up to it.
  std::int64_t outside_grid = 0;  ///< End point outside the grid.
  std::int64_t invalid = 0;       ///< No measurement: zero, NaN or infinite depth.
};

/// What one frame changed in a map.
struct MapUpdate {
  std::int64_t sequence = 0;  ///< Frames integrated so far, this one included.
  Stamp stamp;                ///< Of the frame.
  /// block_linear indices of the blocks in which a voxel became occupied, free or known;
  /// ascending, without repetition.
  std::vector<std::int32_t> changed_blocks;
  bool grid_moved = false;  ///< The mapper's grid() lies elsewhere than before this frame.
  IntegrationCounts counts;
};

/// Builds a map from frames. Optional interfaces are views that a mapper also implements
/// (occupancy_view.hpp), found with dynamic_cast.
class SIDESTEP_EXPORT Mapper {
 public:
  virtual ~Mapper() = default;

  /// Adds a frame. Fails with kBadFrame where the frame is unusable; the map is then
  /// unchanged. [mapping]; allocates.
  [[nodiscard]] virtual Result<MapUpdate> integrate(const Frame& frame) = 0;

  /// The grid whose blocks MapUpdate names. Its size and resolution are constant; its origin
  /// changes only with a frame whose update says that it moved, by whole blocks.
  [[nodiscard]] virtual const GridSpec& grid() const noexcept = 0;
};

}  // namespace sidestep
