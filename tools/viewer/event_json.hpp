#pragma once

#include <nlohmann/json.hpp>

#include <sidestep/runtime/run_observer.hpp>

namespace sidestep {

/// What an event says, as the message `event` to the page has it (docs/reference/viewer.md).
[[nodiscard]] inline nlohmann::ordered_json event_json(const ObservedEvent& observed) {
  using Json = nlohmann::ordered_json;
  const ReplannerEvent& event = observed.event;
  const auto& latency = observed.stamp_to_trajectory_ms;
  return {{"event", to_string(event.kind)},
          {"reason", to_string(event.reason)},
          {"cause", event.cause},
          {"solve_ms", event.solve_ms},
          {"guess", event.guess},
          {"tried", event.tried},
          {"attempts", event.attempts},
          {"cost", event.cost},
          {"takeover_s", event.takeover.seconds()},
          {"map_stamp_s", event.map_stamp.seconds()},
          {"stamp_to_trajectory_ms", latency ? Json(*latency) : Json(nullptr)}};
}

}  // namespace sidestep
