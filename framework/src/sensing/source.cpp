#include <sidestep/sensing/source.hpp>

namespace sidestep {

Source::~Source() = default;

GroundTruth::~GroundTruth() = default;

}  // namespace sidestep
