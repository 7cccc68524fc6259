#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "edt_field.hpp"

namespace sidestep::edt {
namespace {

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext& context) {
  return make_edt_builder(options, context.workers);
}

}  // namespace
}  // namespace sidestep::edt

SIDESTEP_PLUGIN(sidestep::FieldBuilder, sidestep::edt::Options, sidestep::edt::create, "edt",
                "0.1.0", "Exact Euclidean distance transform of dense occupancy",
                sidestep::OccupancyView)
