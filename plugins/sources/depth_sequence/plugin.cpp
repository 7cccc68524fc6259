#include <sidestep/plugin/plugin.hpp>

#include "depth_sequence.hpp"

namespace sidestep::depth_sequence {

static Result<std::unique_ptr<Source>> create(const Options& options, const HostContext& context) {
  return create_source(options, context.log, context.documents);
}

}  // namespace sidestep::depth_sequence

SIDESTEP_PLUGIN(sidestep::Source, sidestep::depth_sequence::Options,
                sidestep::depth_sequence::create, "depth_sequence", "0.1.0",
                "Recorded depth images with camera poses, in the 7-Scenes or TUM RGB-D layout")
