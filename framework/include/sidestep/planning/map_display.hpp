#pragma once

#include <memory>

#include <sidestep/core/export.hpp>
#include <sidestep/field/distance_field.hpp>

namespace sidestep {

/// Optional interface of an executor: display of the map that is planned in, e.g. over a robot's
/// own network. Called by one thread of low priority, beside all others.
class SIDESTEP_EXPORT MapDisplay {
 public:
  virtual ~MapDisplay() = default;

  /// True where a client is connected and an update is due. Polled about 20 times a second.
  [[nodiscard]] virtual bool wants_map() = 0;

  /// Shows a map, not null, and takes its time; may keep it.
  virtual void show_map(std::shared_ptr<const DistanceField> field) = 0;
};

}  // namespace sidestep
