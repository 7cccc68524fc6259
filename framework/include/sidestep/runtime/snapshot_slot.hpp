#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include <sidestep/field/distance_field.hpp>
#include <sidestep/mapping/localiser.hpp>
#include <sidestep/mapping/moving_obstacles.hpp>
#include <sidestep/mapping/tracks.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// The field, the moving obstacles and the tracks after one frame, and where the first of the run's
/// sensors was at its last one.
struct MapSnapshot {
  std::shared_ptr<const DistanceField> field;
  std::shared_ptr<const MovingObstacles> moving = nullptr;  ///< Null without a MotionDetector.
  std::shared_ptr<const Tracks> tracks = nullptr;           ///< Null without a Tracker.
  std::optional<CameraView> camera = std::nullopt;          ///< Nothing where it is no image.
  std::optional<Localisation> localisation = std::nullopt;  ///< Nothing without a Localiser.
};

/// The one thing that mapping and planning share: the newest map. publish() [mapping],
/// pin() [any]; neither waits longer than a pointer's swap; wait_for_newer() [planning]. (A mutex,
/// because std::atomic<std::shared_ptr> is not lock-free in libstdc++ 12 and races under TSan.)
class SnapshotSlot {
 public:
  void publish(MapSnapshot snapshot) {
    {
      const std::lock_guard lock(mutex_);
      std::swap(snapshot_, snapshot);
    }
    published_.notify_all();
    // The previous field, if this was its last holder, is freed here, outside the lock.
  }
  void publish(std::shared_ptr<const DistanceField> field) {
    publish(MapSnapshot{.field = std::move(field)});
  }
  /// The newest field; null before the first publication. Holding it keeps it alive.
  [[nodiscard]] std::shared_ptr<const DistanceField> pin() const { return snapshot().field; }
  /// The newest field with its moving obstacles and tracks.
  [[nodiscard]] MapSnapshot snapshot() const {
    const std::lock_guard lock(mutex_);
    return snapshot_;
  }
  /// Waits until the newest field is another one than `seen`, at most until `until`.
  void wait_for_newer(const std::shared_ptr<const DistanceField>& seen,
                      std::chrono::steady_clock::time_point until) const {
    std::unique_lock lock(mutex_);
    published_.wait_until(lock, until, [&] { return snapshot_.field != seen; });
  }

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable published_;
  MapSnapshot snapshot_;
};

}  // namespace sidestep
