#pragma once

#include <memory>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/field/distance_field.hpp>
#include <sidestep/mapping/mapper.hpp>

namespace sidestep {

/// Turns a map into distance fields, one snapshot per update.
class SIDESTEP_EXPORT FieldBuilder {
 public:
  virtual ~FieldBuilder() = default;

  /// Binds the builder to a mapper, which must outlive it: before anything else, and again after
  /// each update whose grid moved, before that update is given. Forgets what came before.
  /// Fails with kUnsupported where the mapper does not offer the view that the field needs,
  /// naming that view. [mapping]; allocates.
  [[nodiscard]] virtual Result<void> attach(Mapper& mapper) = 0;

  /// The field after `update`, the newest of the attached mapper. Every update must be given
  /// once, in order, before the mapper integrates again; the first may be any. Fails with
  /// kInvalidArgument otherwise, or before attach(). Snapshots already handed out never change.
  /// [mapping]; allocates.
  [[nodiscard]] virtual Result<std::shared_ptr<const DistanceField>> update(
      const MapUpdate& update) = 0;
};

}  // namespace sidestep
