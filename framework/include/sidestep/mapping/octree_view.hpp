#pragma once

#include <sidestep/core/export.hpp>

namespace octomap {
class OcTree;
}

namespace sidestep {

/// A view that a Mapper may offer: its OctoMap. Valid until the next integrate(). [mapping]
///
/// The tree's change detection is on. integrate() starts by resetting it, so that afterwards it
/// holds the changes of the newest frame and no others. The consumer of the view may read and
/// reset them (DynamicEDTOctomap does), but must leave change detection on and the tree's
/// nodes as they are; the mapper relies on neither after integrate() has returned. Mapper and field
/// must be built with the same OctoMap (Debian 12: 1.9.7): the ABI stamp knows nothing of it.
class SIDESTEP_EXPORT OctreeView {
 public:
  static constexpr const char* kViewName = "octree";

  virtual ~OctreeView() = default;
  /// Not const: resetting the change detection is up to the consumer.
  [[nodiscard]] virtual octomap::OcTree& octree() noexcept = 0;
};

}  // namespace sidestep
