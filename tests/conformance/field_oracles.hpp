#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/field_builder.hpp>

#include "grid_map.hpp"

/// A field to be tested, and what it is compared with.
namespace sidestep::conformance {

struct FieldCase {
  std::string name;
  /// A new builder that works with these threads. `workers` outlives it.
  std::function<std::shared_ptr<FieldBuilder>(WorkerPool& workers)> create;
  /// A map of the kind that the field reads.
  std::function<std::unique_ptr<GridMap>(const GridSpec& grid)> create_map =
      [](const GridSpec& grid) { return std::make_unique<GridMap>(grid); };
  bool is_signed = false;
  bool unknown_is_occupied = false;
  double max_distance_m = std::numeric_limits<double>::infinity();
  /// Largest error that the field states against the exact transform; 0: equal as float, to the
  /// last bit. An exact field that rounds in another order states some 1e-6.
  double max_error_m = 0.0;
};

inline void PrintTo(const FieldCase& field, std::ostream* out) { *out << field.name; }

/// Distances by searching all obstacles.
class BruteForce {
 public:
  BruteForce(const GridMap& map, const FieldCase& field) : grid_(map.grid()), field_(field) {
    const Eigen::Vector3i& size = grid_.size_vox;
    for (int z = 0; z < size.z(); ++z) {
      for (int y = 0; y < size.y(); ++y) {
        for (int x = 0; x < size.x(); ++x) {
          const Eigen::Vector3i voxel(x, y, z);
          const bool unknown = field.unknown_is_occupied && !map.known().at(grid_, voxel);
          (map.occupied().at(grid_, voxel) || unknown ? obstacles_ : free_).push_back(voxel);
        }
      }
    }
  }

  /// Nothing to compare with where there is no obstacle and no limit.
  [[nodiscard]] bool defined() const {
    return std::isfinite(field_.max_distance_m) || (!obstacles_.empty() && !free_.empty());
  }

  [[nodiscard]] float at(const Eigen::Vector3i& voxel) const {
    const float outside = nearest(voxel, obstacles_);
    return field_.is_signed ? outside - nearest(voxel, free_) : outside;
  }

 private:
  [[nodiscard]] float nearest(const Eigen::Vector3i& voxel,
                              const std::vector<Eigen::Vector3i>& candidates) const {
    int best = std::numeric_limits<int>::max();
    for (const Eigen::Vector3i& candidate : candidates) {
      best = std::min(best, (candidate - voxel).squaredNorm());
    }
    const auto limit = static_cast<float>(field_.max_distance_m);
    if (best == std::numeric_limits<int>::max()) return limit;
    return std::min(limit,
                    static_cast<float>(grid_.resolution_m * std::sqrt(static_cast<double>(best))));
  }

  GridSpec grid_;
  const FieldCase& field_;
  std::vector<Eigen::Vector3i> obstacles_, free_;
};

/// Voxels low .. high, both included.
struct VoxelBox {
  Eigen::Vector3i low, high;

  [[nodiscard]] bool contains(const Eigen::Vector3i& v) const {
    return (v.array() >= low.array()).all() && (v.array() <= high.array()).all();
  }
  /// From a voxel's centre to that of the box's nearest voxel, in voxels.
  [[nodiscard]] double distance_vox(const Eigen::Vector3i& v) const {
    return (low - v).cwiseMax(v - high).cwiseMax(0).cast<double>().norm();
  }
  /// From a voxel within to the nearest one outside, in voxels.
  [[nodiscard]] double depth_vox(const Eigen::Vector3i& v) const {
    return 1.0 + (v - low).cwiseMin(high - v).minCoeff();
  }
};

}  // namespace sidestep::conformance
