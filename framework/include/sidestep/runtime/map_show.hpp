#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include <sidestep/core/log.hpp>
#include <sidestep/planning/map_display.hpp>
#include <sidestep/runtime/snapshot_slot.hpp>

namespace sidestep {

/// Hands the newest map of a slot to a display whenever that wants one, in a thread of its own.
class MapShow {
 public:
  /// Starts the thread. What the references refer to outlives this. `shower`: whose display it is.
  /// A display that fails is asked no more, and the log says so.
  MapShow(MapDisplay& display, const SnapshotSlot& slot, std::string shower, Log& log);

 private:
  void work(const std::stop_token& stop);
  /// False once the display has failed.
  bool show();

  MapDisplay& display_;
  const SnapshotSlot& slot_;
  std::string shower_;
  Log& log_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;  ///< The last: it uses the others.
};

}  // namespace sidestep
