#pragma once

#include <sidestep/core/time.hpp>
#include <sidestep/core/worker_pool.hpp>

#include "log_odds_grid.hpp"

namespace sidestep::voxel_grid {

/// Lets a map forget what is not seen: log-odds fade exponentially towards 0, and a voxel whose
/// log-odds have come near to 0 is unknown again. A block counts as seen where a frame changed, or
/// confirmed, any of its voxels. Each call looks at a sixteenth of the blocks, so that no frame has
/// to fade all of a map.
class VoxelFader {
 public:
  VoxelFader(double half_life_s, LogOddsGrid& map, WorkerPool& workers);

  /// Brings a part of the map to the time of a frame that has been integrated. [mapping]
  void fade(Stamp now);

 private:
  double half_life_s_;
  LogOddsGrid& map_;
  WorkerPool& workers_;
  int turn_ = 0;
};

}  // namespace sidestep::voxel_grid
