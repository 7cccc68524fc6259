#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/tsdf_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "esdf_field.hpp"

namespace sidestep::esdf {
namespace {

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext& context) {
  return make_esdf_builder(options, context.workers);
}

}  // namespace
}  // namespace sidestep::esdf

SIDESTEP_PLUGIN(sidestep::FieldBuilder, sidestep::esdf::Options, sidestep::esdf::create, "esdf",
                "0.1.0", "Signed distances spread from a TSDF by wavefronts, as in Voxblox",
                sidestep::TsdfView, sidestep::OccupancyView)
