#pragma once

#include <memory>
#include <vector>

#include <sidestep/plugin/plugin.hpp>

namespace chessboard {

/// The parameters, declared once: names, units, ranges and docs here, types and defaults above.
struct Options {
  double max_distance_m = 0.8;
  double inflation_m = 0.0;

  static sidestep::Parameters<Options> parameters() {
    return sidestep::Parameters<Options>()
        .add("max_distance_m", &Options::max_distance_m, "Distances are cut off here.",
             {.unit = "m", .min = 0.01})
        .add("inflation_m", &Options::inflation_m, "Obstacles count as this much larger.",
             {.unit = "m", .min = 0.0});
  }

  /// What no range can say: mistakes in several parameters together.
  [[nodiscard]] std::vector<sidestep::OptionMistake> check() const {
    if (inflation_m < max_distance_m) return {};
    return {{{"inflation_m", "max_distance_m"}, "must be below max_distance_m", {}}};
  }
};

/// What the host calls, and the tests.
sidestep::Result<std::unique_ptr<sidestep::FieldBuilder>> create(
    const Options& options, const sidestep::HostContext& context);

}  // namespace chessboard
