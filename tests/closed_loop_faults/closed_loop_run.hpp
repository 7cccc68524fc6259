#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/runtime/results_store.hpp>

#include "../integration/command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {

/// An event as results.sqlite has it.
struct StoredEvent {
  double time_s = 0.0;
  std::string kind, reason, cause;
};

/// `sidestep run` on faults.yaml, and what it left behind.
class ClosedLoopRun {
 public:
  explicit ClosedLoopRun(std::vector<std::string> sets) {
    setenv("SIDESTEP_PLUGIN_PATH", FAULTY_PLUGINS, 1);
    std::vector<std::string> arguments = {
        "run", SIDESTEP_SOURCE_DIR "/tests/closed_loop_faults/faults.yaml", "--out",
        folder_.path().string()};
    for (std::string& set : sets) {
      arguments.emplace_back("--set");
      arguments.push_back(std::move(set));
    }
    finished = run(arguments);
    unsetenv("SIDESTEP_PLUGIN_PATH");
    report = read_file(folder_.path() / "report.html");
    summary = nlohmann::json::parse(read_file(folder_.path() / "summary.json"), nullptr, false);
    const auto reader = ResultsReader::open(folder_.path() / "results.sqlite");
    if (!reader) return;
    const auto times_s = (*reader)->column("event", "time_s").value_or(std::vector<double>());
    for (std::size_t i = 0; i < times_s.size(); ++i) {
      const auto text = [&](const char* key) {
        return (*reader)->text("event", static_cast<std::int64_t>(i), key)->value_or("");
      };
      events.push_back({times_s[i], text("kind_name"), text("reason"), text("cause")});
    }
    if (const auto array = (*reader)->array("episode", 0, "motion"); array && *array) {
      motion = std::move(**array);
    }
  }

  static auto is_of(const std::string& kind, const std::string& reason) {
    return [&](const StoredEvent& e) { return e.kind == kind && e.reason == reason; };
  }
  [[nodiscard]] const StoredEvent* first(const std::string& kind, const std::string& reason) const {
    const auto found = std::ranges::find_if(events, is_of(kind, reason));
    return found == events.end() ? nullptr : &*found;
  }
  [[nodiscard]] const StoredEvent* last(const std::string& kind, const std::string& reason) const {
    const auto found = std::find_if(events.rbegin(), events.rend(), is_of(kind, reason));
    return found == events.rend() ? nullptr : &*found;
  }
  /// How far the robot truly moved in a span of time.
  [[nodiscard]] double moved_m(double from_s, double to_s) const {
    std::optional<int> first;
    double moved_m = 0.0;
    for (int i = 0; i < motion.rows; ++i) {
      if (at(i, 0) < from_s || at(i, 0) > to_s) continue;
      if (!first) first = i;
      moved_m = std::max(moved_m, std::hypot(at(i, 1) - at(*first, 1), at(i, 2) - at(*first, 2)));
    }
    return moved_m;
  }
  /// Between its last two true states; infinite where there are none.
  [[nodiscard]] double last_speed_mps() const {
    const int last = motion.rows - 1;
    if (last < 1) return std::numeric_limits<double>::infinity();
    return std::hypot(at(last, 1) - at(last - 1, 1), at(last, 2) - at(last - 1, 2)) /
           (at(last, 0) - at(last - 1, 0));
  }
  [[nodiscard]] std::string story() const {
    std::string text = finished.error;
    for (const StoredEvent& e : events) {
      text += std::to_string(e.time_s) + " " + e.kind + " (" + e.reason + "): " + e.cause + "\n";
    }
    return text + summary.dump();
  }

  Finished finished;
  std::string report;
  nlohmann::json summary;
  std::vector<StoredEvent> events;
  StoredArray motion;  ///< Time, x and y, 25 times a second.

 private:
  [[nodiscard]] double at(int row, int column) const {
    return static_cast<double>(
        motion.values[static_cast<std::size_t>(row * motion.columns + column)]);
  }

  testing_support::TemporaryFolder folder_;
};

}  // namespace sidestep::testing
