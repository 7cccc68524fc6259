#pragma once

#include <memory>

#include <sidestep/core/export.hpp>
#include <sidestep/field/distance_field.hpp>

namespace sidestep {

/// What an executor offers in addition where it can show people the map that is planned in, e.g.
/// over a robot's own network. Called by one thread of low priority, beside all others.
class SIDESTEP_EXPORT MapDisplay {
 public:
  virtual ~MapDisplay() = default;

  /// Whether somebody looks, and another picture is due: asked some twenty times a second.
  [[nodiscard]] virtual bool wants_map() = 0;

  /// Shows a map, not null, and takes its time; may keep it.
  virtual void show_map(std::shared_ptr<const DistanceField> field) = 0;
};

}  // namespace sidestep
