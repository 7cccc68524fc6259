#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/octree_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "dynamic_edt_field.hpp"

namespace sidestep::dynamic_edt {
namespace {

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext& context) {
  return make_dynamic_edt_builder(options, context.workers);
}

}  // namespace
}  // namespace sidestep::dynamic_edt

SIDESTEP_PLUGIN(sidestep::FieldBuilder, sidestep::dynamic_edt::Options,
                sidestep::dynamic_edt::create, "dynamic_edt", "0.1.0",
                "Distances by dynamicEDT3D (Lau 2010) on an OctoMap", sidestep::OccupancyView,
                sidestep::OctreeView)
