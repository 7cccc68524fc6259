#include <sidestep/sensing/source.hpp>

namespace sidestep {

Source::~Source() = default;

GroundTruth::~GroundTruth() = default;

std::shared_ptr<const Scene> GroundTruth::scene_until(Stamp /*time*/) {
  return std::make_shared<const Scene>(scene());
}

}  // namespace sidestep
