#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>

#include <sidestep/report/html.hpp>
#include <sidestep/report/run_report.hpp>
#include <sidestep/report/text_table.hpp>
#include "replan_figures.hpp"
#include "replan_rows.hpp"
#include "replan_summary.hpp"

namespace sidestep::report {
namespace {

constexpr std::size_t kPicturedEpisodes = 6;

std::string collisions_section(const Json& summary) {
  const Json collisions = at(summary, "/collisions");
  if (!collisions.is_array() || collisions.empty()) return "";
  std::vector<Row> rows;
  for (const Json& contact : collisions) {
    rows.push_back({cell(at(contact, "/episode")), cell(at(contact, "/time_s"), "%.2f s"),
                    cell(at(contact, "/link")), cell(at(contact, "/object")),
                    cell(at(contact, "/depth_m"), "%.3f m"), cell(at(contact, "/cause"))});
  }
  return "<h2>True collisions</h2>\n" +
         html_table({"episode", "at", "link", "object", "depth", "cause"}, rows);
}

std::string failures_section(const Json& failures) {
  if (!failures.is_array() || failures.empty()) return "";
  std::string html = "<h2>Episodes that failed</h2>\n";
  for (const Json& failure : failures) {
    const std::string episode = cell(at(failure, "/episode"));
    html += "<details><summary>Episode " + episode + ": " +
            escape_html(cell(at(failure, "/reason"))) + "</summary>\n";
    if (at(failure, "/again").is_string()) {
      html += "<p>Watch it again:</p><pre>" +
              escape_html(at(failure, "/again").get<std::string>() + " --view --open") + "</pre>\n";
    }
    html += "</details>\n";
  }
  return html;
}

/// What the paper says of its own loop, beside this run's.
std::string comparison_section(const Json& summary) {
  return html_table(
      {"", "this run", "Finean 2021"},
      {{"what is followed is checked",
        cell(at(summary, "/check_hz"), "%.0f Hz") + ", computed anew at " +
            cell(at(summary, "/new_check_hz"), "%.0f Hz"),
        "250 Hz"},
       {"solve p50", cell(at(summary, "/solve_ms/p50"), "%.2f ms"), "at most 100 ms (10 Hz)"}});
}

/// Numbers of the series "episode" or "event", of all items.
Result<std::vector<double>> numbers_of(ResultsReader& results, const std::string& series,
                                       std::string_view wanted) {
  std::vector<double> values;
  SIDESTEP_TRY(results.visit(series, [&](std::int64_t, std::string_view key, double value) {
    if (key == wanted && std::isfinite(value)) values.push_back(value);
  }));
  return values;
}

/// How what was measured is spread over the run; nothing where too little was.
Result<std::string> spread_section(ResultsReader& results, const std::filesystem::path& run) {
  struct Quantity {
    const char* series;
    const char* key;
    const char* label;
  };
  constexpr std::array kQuantities = {
      Quantity{"event", "solve_ms", "solve, in vain or not [ms]"},
      Quantity{"event", "stamp_to_trajectory_ms", "stamp to trajectory [ms]"},
      Quantity{"episode", "duration_s", "time of an episode [s]"},
      Quantity{"episode", "min_true_clearance_m", "least true clearance [m]"}};
  std::vector<Spread> spreads;
  for (const Quantity& quantity : kQuantities) {
    auto values = SIDESTEP_TRY(numbers_of(results, quantity.series, quantity.key));
    std::erase(values, 0.0);  // events without a solve
    spreads.push_back({quantity.label, std::move(values)});
  }
  return figure_section(spread_figures(spreads), run);
}

/// The first episode that was run, then those that failed, then the second.
Result<std::vector<std::int64_t>> chosen_episodes(const Json& summary, ResultsReader& results) {
  std::set<std::int64_t> run;  // numbered from experiment.first_episode
  SIDESTEP_TRY(results.visit(
      "episode", [&](std::int64_t item, std::string_view, double) { run.insert(item); }));
  std::vector<std::int64_t> chosen;
  const auto choose = [&](std::int64_t episode) {
    if (chosen.size() < kPicturedEpisodes && std::ranges::find(chosen, episode) == chosen.end()) {
      chosen.push_back(episode);
    }
  };
  if (!run.empty()) choose(*run.begin());
  for (const Json& failure : at(summary, "/failures")) {
    choose(at(failure, "/episode").get<std::int64_t>());
  }
  if (run.size() > 1) choose(*std::next(run.begin()));
  return chosen;
}

Result<std::string> events_section(ResultsReader& results, std::int64_t episode) {
  const auto events = SIDESTEP_TRY(read_events(results, episode));
  std::vector<Row> rows;
  for (const auto& [item, event] : events) {
    const auto text = [&, item = item](const char* key) {
      const auto value = results.text("event", item, key);
      return value ? value->value_or("") : std::string();
    };
    const auto number = [](const std::optional<double>& value, const char* pattern) {
      return cell(value ? Json(*value) : Json(nullptr), pattern);
    };
    rows.push_back({format("%.3f s", event.time_s), std::string(to_string(event.kind)),
                    text("cause"), text("guess"), std::to_string(event.attempts),
                    format("%.2f ms", event.solve_ms), number(event.map_age_ms, "%.1f ms"),
                    number(event.stamp_to_trajectory_ms, "%.1f ms"),
                    format("%.2g", event.splice_velocity_jump)});
  }
  return "<details><summary>Events</summary>\n" +
         html_table({"at", "event", "cause", "guess", "attempts", "solve", "map's age",
                     "stamp to trajectory", "velocity jump"},
                    rows) +
         "</details>\n";
}

Result<std::string> replan_body(const Json& summary, ResultsReader& results,
                                const std::filesystem::path& run) {
  std::string html = replan_metrics().html(replan_metrics().rows_of(summary)) +
                     comparison_section(summary) + collisions_section(summary) +
                     failures_section(at(summary, "/failures"));
  if (!at(summary, "/episodes").is_number_integer()) return html;
  auto spread = SIDESTEP_TRY(spread_section(results, run));
  html += spread;
  const auto chosen = SIDESTEP_TRY(chosen_episodes(summary, results));
  for (const std::int64_t episode : chosen) {
    html += "<h2>Episode " + std::to_string(episode) + "</h2>\n";
    const auto figures = SIDESTEP_TRY(replan_figures(results, episode));
    auto section = SIDESTEP_TRY(figure_section(figures, run));
    auto events = SIDESTEP_TRY(events_section(results, episode));
    html += section + events;
  }
  return html;
}

}  // namespace
}  // namespace sidestep::report

namespace sidestep {

const report::RunReport& replan_report() {
  static const report::RunReport kReport = {.body = &report::replan_body,
                                            .columns = &replan_metrics(),
                                            .pictures = {"episode-", "spread."}};
  return kReport;
}

}  // namespace sidestep
