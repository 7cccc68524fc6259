#include "driver_table.hpp"

#include <algorithm>

#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/summary.hpp>

namespace sidestep::plain_driver {
namespace {

using Json = nlohmann::ordered_json;

Json quantiles_json(const std::vector<double>& values) {
  return {{"p50", quantile_json(values, 0.5)}, {"p95", quantile_json(values, 0.95)}};
}

/// Of a state check, in us; null for none that was timed.
Json mean_check_us(const std::vector<Solve>& solves) {
  double sum_us = 0.0;
  double timed = 0.0;
  for (const Solve& solve : solves) {
    sum_us += solve.answer.count.timed_us;
    timed += static_cast<double>(solve.answer.count.timed);
  }
  if (timed == 0.0) return nullptr;
  return sum_us / timed;
}

/// Of the paths that are found in collision how many are so at the points that OMPL tests, and how
/// deep the others are.
Json collisions_of(const std::vector<Solve>& solved) {
  const auto colliding = those_of(
      solved, [](const Solve& s) { return s.answer.is_broken || s.verdict.is_in_collision; });
  const auto between = those_of(colliding, [](const Solve& s) { return !s.answer.is_broken; });
  const auto depths_m = values_of(between, [](const Solve& s) { return s.verdict.depth_m; });
  return {{"paths", colliding.size()},
          {"at_points", colliding.size() - between.size()},
          {"deepest_between_m",
           depths_m.empty() ? Json(nullptr) : Json(*std::ranges::max_element(depths_m))}};
}

Json row_of(const std::string& family, const std::vector<Solve>& solves, bool with_shapes) {
  const auto solved = those_of(solves, [](const Solve& s) { return s.answer.is_solved; });
  const auto of_answers = [&](auto value) {
    return values_of(solved, [&](const Solve& s) { return value(s.answer); });
  };
  const auto touching =
      std::ranges::count_if(solved, [](const Solve& s) { return s.verdict.is_touching; });
  using A = PlainAnswer;
  return {{"family", family},
          {"problems", solves.size()},
          {"solved", solved.size()},
          {"setup_ms", quantiles_json(of_answers([](const A& a) { return a.setup_ms; }))},
          {"search_ms", quantiles_json(of_answers([](const A& a) { return a.search_ms; }))},
          {"simplified_ms",
           quantiles_json(of_answers([](const A& a) { return a.search_ms + a.simplify_ms; }))},
          {"states", quantiles_json(of_answers([](const A& a) { return a.count.states; }))},
          {"state_check_us", mean_check_us(solves)},
          {"path_length_rad", quantiles_json(of_answers([](const A& a) { return a.length; }))},
          {"in_collision", collisions_of(solved)},
          {"unproven",
           std::ranges::count_if(solved, [](const Solve& s) { return s.verdict.is_unproven; })},
          {"shapes_touching", with_shapes ? Json(touching) : Json(nullptr)}};
}

std::vector<std::string> families_of(const std::vector<Solve>& solves) {
  std::vector<std::string> families;
  for (const Solve& solve : solves) {
    if (std::ranges::find(families, solve.family) == families.end()) {
      families.push_back(solve.family);
    }
  }
  return families;
}

}  // namespace

Json summary_of(const std::vector<Solve>& solves, bool with_shapes) {
  Json rows = Json::array({row_of("all", solves, with_shapes)});
  for (const std::string& family : families_of(solves)) {
    const auto own = those_of(solves, [&](const Solve& s) { return s.family == family; });
    rows.push_back(row_of(family, own, with_shapes));
  }
  Json unsolved = Json::array();
  for (const Solve& solve : solves) {
    if (solve.answer.is_solved) continue;
    unsolved.push_back(solve.family + " " + std::to_string(solve.index));
  }
  return {{"rows", rows}, {"unsolved", unsolved}};
}

std::string table_text(const Json& summary) {
  report::Columns columns = {{"family", "/family"},
                             {"problems", "/problems", "%.0f"},
                             {"solved", "/solved", "%.0f"},
                             {"set-up p50", "/setup_ms/p50", "%.2f ms"},
                             {"search p50", "/search_ms/p50", "%.2f ms"},
                             {"p95", "/search_ms/p95", "%.1f ms"},
                             {"simplified p50", "/simplified_ms/p50", "%.2f ms"},
                             {"p95", "/simplified_ms/p95", "%.1f ms"},
                             {"states p50", "/states/p50", "%.0f"},
                             {"state check", "/state_check_us", "%.2f us"},
                             {"path p50", "/path_length_rad/p50", "%.2f rad"},
                             {"in collision", "/in_collision/paths", "%.0f"},
                             {"at points", "/in_collision/at_points", "%.0f"},
                             {"deepest between", "/in_collision/deepest_between_m", "%.5f m"},
                             {"unproven", "/unproven", "%.0f"}};
  if (!summary["rows"][0]["shapes_touching"].is_null()) {
    columns.push_back({"shapes touching", "/shapes_touching", "%.0f"});
  }
  std::string text = report::text_table(columns, summary["rows"]);
  for (const Json& name : summary["unsolved"]) {
    text += "without a path: " + name.get<std::string>() + "\n";
  }
  return text;
}

}  // namespace sidestep::plain_driver
