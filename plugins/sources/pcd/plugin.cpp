#include <sidestep/plugin/plugin.hpp>

#include "pcd_source.hpp"

namespace sidestep::pcd {

static Result<std::unique_ptr<Source>> create(const Options& options, const HostContext& context) {
  return create_source(options, context.seed, context.log);
}

}  // namespace sidestep::pcd

SIDESTEP_PLUGIN(sidestep::Source, sidestep::pcd::Options, sidestep::pcd::create, "pcd", "0.1.0",
                "Recorded point clouds in PCD files, with poses and point-cloud filters by PCL")
