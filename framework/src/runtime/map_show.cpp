#include <sidestep/runtime/map_show.hpp>

#include <chrono>
#include <utility>

#include <sidestep/core/low_priority.hpp>
#include <sidestep/runtime/call_plugin.hpp>

namespace sidestep {
namespace {

constexpr auto kLook = std::chrono::milliseconds(50);

}  // namespace

MapShow::MapShow(MapDisplay& display, const SnapshotSlot& slot, std::string shower, Log& log)
    : display_(display),
      slot_(slot),
      shower_(std::move(shower)),
      log_(log),
      thread_([this](const std::stop_token& stop) { work(stop); }) {}

bool MapShow::show() {
  const auto shown = call_plugin(shower_, [&]() -> Result<void> {
    if (!display_.wants_map()) return {};
    if (auto field = slot_.pin()) display_.show_map(std::move(field));
    return {};
  });
  if (!shown) log_.warn("the map is shown no more: " + shown.error().describe());
  return shown.has_value();
}

void MapShow::work(const std::stop_token& stop) {
  lower_thread_priority();
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested() && show()) {
    wake_.wait_for(lock, stop, kLook, [] { return false; });
  }
}

}  // namespace sidestep
