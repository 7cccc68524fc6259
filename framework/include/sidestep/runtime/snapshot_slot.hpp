#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include <sidestep/field/distance_field.hpp>

namespace sidestep {

/// The one thing that mapping and planning share: the newest field. publish() [mapping],
/// pin() [any]; neither waits longer than a pointer's swap. (A mutex, because
/// std::atomic<std::shared_ptr> is not lock-free in libstdc++ 12 and races under TSan.)
class SnapshotSlot {
 public:
  void publish(std::shared_ptr<const DistanceField> field) {
    {
      const std::lock_guard lock(mutex_);
      field_.swap(field);
    }
    // The previous field, if this was its last holder, is freed here, outside the lock.
  }
  /// The newest field; null before the first publication. Holding it keeps it alive.
  [[nodiscard]] std::shared_ptr<const DistanceField> pin() const {
    const std::lock_guard lock(mutex_);
    return field_;
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const DistanceField> field_;
};

}  // namespace sidestep
