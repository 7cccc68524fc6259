#pragma once

#include <span>

#include <sidestep/mapping/mapper.hpp>

namespace sidestep::voxel_grid {

inline void add(IntegrationCounts& to, const IntegrationCounts& more) {
  to.points += more.points;
  to.inserted += more.inserted;
  to.floor += more.floor;
  to.self += more.self;
  to.out_of_range += more.out_of_range;
  to.outside_grid += more.outside_grid;
  to.invalid += more.invalid;
}

[[nodiscard]] inline IntegrationCounts sum(std::span<const IntegrationCounts> parts) {
  IntegrationCounts all;
  for (const IntegrationCounts& part : parts) add(all, part);
  return all;
}

}  // namespace sidestep::voxel_grid
