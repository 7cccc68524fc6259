#pragma once

#include <optional>
#include <string>
#include <vector>

#include <sidestep/report/canvas.hpp>

namespace sidestep {

/// One bar of the chart of a mapping benchmark.
struct SystemBar {
  std::string label;
  double resolution_m = 0.0;
  bool is_signed = false;
  double mean_ms = 0.0;
  double p50_ms = 0.0;
  double p95_ms = 0.0;
  std::optional<double> published_ms;
};

/// The pictures of a mapping benchmark; `published_as` names where published figures are from.
[[nodiscard]] std::vector<Figure> mapping_figures(const std::vector<SystemBar>& bars,
                                                  const std::string& published_as);

}  // namespace sidestep
