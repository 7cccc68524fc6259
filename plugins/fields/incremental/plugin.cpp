#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "incremental_field.hpp"

namespace sidestep::incremental {
namespace {

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext& context) {
  return make_incremental_builder(options, context.workers);
}

}  // namespace
}  // namespace sidestep::incremental

SIDESTEP_PLUGIN(sidestep::FieldBuilder, sidestep::incremental::Options,
                sidestep::incremental::create, "incremental", "0.1.0",
                "Distances kept up to date by lists of closest obstacles (FIESTA, Han 2019)",
                sidestep::OccupancyView)
