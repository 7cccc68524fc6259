#pragma once

#include <octomap/octomap.h>

#include <sidestep/mapping/octree_view.hpp>

#include "conformance/grid_map.hpp"

namespace sidestep::conformance {

/// A GridMap that keeps an OctoMap of the same voxels.
class OctreeMap final : public GridMap, public OctreeView {
 public:
  explicit OctreeMap(const GridSpec& grid) : GridMap(grid), tree_(grid.resolution_m) {
    tree_.enableChangeDetection(true);
  }

  void set(const Eigen::Vector3i& voxel, bool occupied) override {
    GridMap::set(voxel, occupied);
    const Eigen::Vector3f centre = grid().centre_m(voxel).cast<float>();
    // The step is far beyond the clamp, so one update decides.
    tree_.updateNode(octomap::point3d(centre.x(), centre.y(), centre.z()),
                     occupied ? 100.0F : -100.0F);
  }

  octomap::OcTree& octree() noexcept override { return tree_; }

 private:
  octomap::OcTree tree_;
};

}  // namespace sidestep::conformance
