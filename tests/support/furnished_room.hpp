#pragma once

#include <random>
#include <vector>

#include "conformance/grid_map.hpp"

namespace sidestep::testing_support {

/// A room as a depth camera maps it: the surfaces, one voxel thick, of a floor, two walls and
/// furniture, and scattered false points. 8 x 8 x 3.2 m with its lower corner at the origin; at
/// 0.025 m about 100,000 of 13.1 million voxels are occupied.
class FurnishedRoom {
 public:
  static GridSpec grid(double resolution_m) {
    GridSpec grid;
    grid.resolution_m = resolution_m;
    grid.size_vox = (Eigen::Vector3d(8.0, 8.0, 3.2) / resolution_m).array().round().cast<int>();
    return grid;
  }

  /// Marks the room's surfaces in an empty map of grid().
  static void furnish(conformance::GridMap& map) {
    for (const Box& box : boxes()) set_shell(map, box, true);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> within(0.0, 1.0);
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d p(8.0 * within(random), 8.0 * within(random), 3.2 * within(random));
      map.set(map.grid().voxel_at(p), true);
    }
  }

  /// A box the size of a person, and its surface in the map.
  static void set_walker(conformance::GridMap& map, double x_m, bool present) {
    set_shell(map, {{x_m, 4.5, 0.1}, {x_m + 0.4, 5.0, 1.8}}, present);
  }

 private:
  struct Box {
    Eigen::Vector3d lower_m;
    Eigen::Vector3d upper_m;
  };

  static std::vector<Box> boxes() {
    std::vector<Box> all = {
        {{2.5, 2.0, 0.0}, {7.0, 6.5, 0.02}},                                        // floor
        {{7.0, 3.0, 0.0}, {7.02, 6.5, 2.2}},  {{3.0, 6.5, 0.0}, {7.0, 6.52, 1.2}},  // walls
        {{6.4, 1.6, 0.0}, {7.0, 5.0, 0.9}},   {{6.6, 1.6, 1.4}, {7.0, 5.0, 2.1}},   // counter
        {{6.3, 5.4, 0.0}, {7.0, 6.1, 1.9}},                                         // fridge
        {{3.5, 2.5, 0.68}, {4.7, 4.3, 0.72}},                                       // table
        {{4.0, 3.0, 0.72}, {4.2, 3.3, 0.95}}, {{4.3, 3.7, 0.72}, {4.4, 3.8, 0.85}}};
    for (const double x : {3.55, 4.6}) {
      for (const double y : {2.55, 4.2}) all.push_back({{x, y, 0.0}, {x + 0.05, y + 0.05, 0.7}});
    }
    for (const double y : {2.6, 3.6}) {  // chairs
      all.push_back({{2.9, y, 0.42}, {3.3, y + 0.4, 0.46}});
      all.push_back({{2.9, y, 0.46}, {2.94, y + 0.4, 0.95}});
    }
    for (const double z : {0.4, 0.8, 1.2, 1.6}) {  // shelves
      all.push_back({{2.5, 6.2, z}, {4.5, 6.5, z + 0.03}});
    }
    return all;
  }

  /// The voxels of the box that touch its outside.
  static void set_shell(conformance::GridMap& map, const Box& box, bool occupied) {
    const GridSpec& grid = map.grid();
    const Eigen::Vector3i low = grid.voxel_at(box.lower_m).cwiseMax(0);
    const Eigen::Vector3i high =
        grid.voxel_at(box.upper_m).cwiseMax(low).cwiseMin(grid.size_vox - Eigen::Vector3i::Ones());
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int x = low.x(); x <= high.x(); ++x) {
          const Eigen::Vector3i voxel(x, y, z);
          if ((voxel.array() == low.array()).any() || (voxel.array() == high.array()).any()) {
            map.set(voxel, occupied);
          }
        }
      }
    }
  }
};

}  // namespace sidestep::testing_support
