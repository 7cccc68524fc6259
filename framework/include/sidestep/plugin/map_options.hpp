#pragma once

#include <utility>
#include <vector>

#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/point_rules.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep {

/// The parameters that a mapper on a grid has: where its voxels are, and what counts as a
/// measurement. A mapper's options derive from it, and declare them with declare_grid() and
/// declare_measurement().
struct MapOptions {
  double resolution_m = 0.025;
  Eigen::Vector3i size_vox{320, 320, 128};
  Eigen::Vector3d origin_m{-4.0, -4.0, 0.0};
  double min_range_m = 0.0;
  double max_range_m = 5.0;
  double floor_z_m = 0.0;
  double floor_clearance_m = 0.03;
  bool clear_no_return = false;
  double self_filter_margin_m = 0.03;

  [[nodiscard]] GridSpec grid() const { return {origin_m, resolution_m, size_vox}; }
  [[nodiscard]] PointRules rules() const {
    return {min_range_m, max_range_m, floor_z_m, floor_clearance_m};
  }
};

/// What is wrong with the options of a map that takes `needed_mib` of memory: ranges that exclude
/// each other, a grid that has no room in this machine. A mapper's check() begins with it. [any]
[[nodiscard]] std::vector<OptionMistake> check_map_options(const MapOptions& options,
                                                           double needed_mib);

/// Voxels of the whole blocks that cover the grid; a double, for it may be beyond any integer.
[[nodiscard]] double voxels_of_blocks(const MapOptions& options);

/// Adds resolution_m, size_vox and origin_m. `O` derives from MapOptions.
template <class O>
[[nodiscard]] Parameters<O> declare_grid(Parameters<O> parameters) {
  return std::move(parameters)
      .add("resolution_m", &MapOptions::resolution_m, "Edge of a voxel.",
           {.unit = "m", .min = 1e-4})
      .add("size_vox", &MapOptions::size_vox, "Voxels along x, y and z.", {.unit = "vox", .min = 1})
      .add("origin_m", &MapOptions::origin_m, "Lower corner of the grid in the world.",
           {.unit = "m"});
}

/// Adds the ranges, the floor rule, clear_no_return and self_filter_margin_m.
template <class O>
[[nodiscard]] Parameters<O> declare_measurement(Parameters<O> parameters) {
  return std::move(parameters)
      .add("min_range_m", &MapOptions::min_range_m, "Nearer points count as no measurement.",
           {.unit = "m", .min = 0.0})
      .add("max_range_m", &MapOptions::max_range_m,
           "Farther points are not inserted; rays end here.", {.unit = "m", .min = 0.0})
      .add("floor_z_m", &MapOptions::floor_z_m, "Height of the floor in the world.", {.unit = "m"})
      .add("floor_clearance_m", &MapOptions::floor_clearance_m,
           "Points lower than this above the floor clear along their ray and are not inserted.",
           {.unit = "m"})
      .add("clear_no_return", &MapOptions::clear_no_return,
           "Whether a pixel without return (depth 0) clears up to max_range_m.")
      .add("self_filter_margin_m", &MapOptions::self_filter_margin_m,
           "Points this near to the robot's spheres are its own and are dropped.",
           {.unit = "m", .min = 0.0});
}

}  // namespace sidestep
