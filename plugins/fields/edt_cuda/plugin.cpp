#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "edt_cuda_field.hpp"

namespace sidestep::edt_cuda {
namespace {

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext& context) {
  return make_edt_cuda_builder(options, context.workers, context.log,
                               [device = options.device](const TransformSettings& settings) {
                                 return make_device_transform(settings, device);
                               });
}

}  // namespace
}  // namespace sidestep::edt_cuda

SIDESTEP_PLUGIN(sidestep::FieldBuilder, sidestep::edt_cuda::Options, sidestep::edt_cuda::create,
                "edt_cuda", "0.1.0",
                "Exact Euclidean distance transform of dense occupancy on a GPU",
                sidestep::OccupancyView)
