#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/octree_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "octomap_mapper.hpp"

SIDESTEP_PLUGIN(sidestep::Mapper, sidestep::octomap_mapper::OctomapOptions,
                sidestep::octomap_mapper::create, "octomap", "0.1.0",
                "Probabilistic octree of the OctoMap library, within a bounding grid",
                sidestep::OccupancyView, sidestep::OctreeView)
