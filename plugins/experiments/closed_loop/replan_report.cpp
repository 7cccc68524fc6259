#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <set>

#include <sidestep/report/chart.hpp>
#include <sidestep/results/summary.hpp>
#include <sidestep/runtime/replanner.hpp>
#include "closed_loop.hpp"

namespace sidestep {
namespace {

using namespace report;

constexpr double kWidth = 900.0;
constexpr int kColumns = 4;
constexpr double kCaption = 20.0;
constexpr double kBorder_m = 0.7;
constexpr Colour kObstacle = colour(0xBBBBBB);

/// The ground from above, x to the right and y up, in a part of a canvas.
struct GroundView {
  Range x, y;
  Area area;

  [[nodiscard]] double scale() const { return area.width / (x.upper - x.lower); }
  [[nodiscard]] Point at(double x_m, double y_m) const {
    return {area.x + scale() * (x_m - x.lower), area.y + scale() * (y.upper - y_m)};
  }
  [[nodiscard]] std::vector<Point> points(const StoredArray& array) const {
    std::vector<Point> points;
    for (std::size_t i = 0; i + 1 < array.values.size(); i += 2) {
      points.push_back(at(array.values[i], array.values[i + 1]));
    }
    return points;
  }
};

/// One picture, as it was recorded.
struct View {
  double time_s = 0.0;
  StoredArray robot, goal, way_base, way_hand, plan_base, plan_hand;
  std::vector<std::pair<StoredArray, bool>> objects;  ///< Outline, whether it moves.
};

double number_of(ResultsReader& results, const std::string& series, std::int64_t item,
                 const std::string& key, double otherwise) {
  const auto number = results.number(series, item, key);
  return number ? number->value_or(otherwise) : otherwise;
}

StoredArray array_of(ResultsReader& results, const std::string& series, std::int64_t item,
                     const std::string& key) {
  auto array = results.array(series, item, key);
  return array && *array ? std::move(**array) : StoredArray{};
}

Result<std::vector<View>> read_views(ResultsReader& results, std::int64_t episode) {
  const std::string series = "picture/" + std::to_string(episode);
  const auto items = SIDESTEP_TRY(results.array_items(series, "robot"));
  std::vector<View> views;
  for (const std::int64_t item : items) {
    const auto read = [&](const std::string& key) { return array_of(results, series, item, key); };
    const auto number = [&](const std::string& key) {
      return number_of(results, series, item, key, 0.0);
    };
    View view{number("time_s"), read("robot"),     read("goal"),      read("way.base"),
              read("way.hand"), read("plan.base"), read("plan.hand"), {}};
    for (int i = 0;; ++i) {
      const std::string key = "object." + std::to_string(i);
      StoredArray outline = read(key);
      if (outline.rows == 0) break;
      view.objects.emplace_back(std::move(outline), number(key + ".moves") != 0.0);
    }
    views.push_back(std::move(view));
  }
  return views;
}

/// A square around all that the robot does.
GroundView ground_of(const std::vector<View>& views) {
  Range x{INFINITY, -INFINITY}, y{INFINITY, -INFINITY};
  const auto include = [&](const StoredArray& array, std::size_t columns) {
    for (std::size_t i = 0; i + 1 < array.values.size(); i += columns) {
      x.include(array.values[i]);
      y.include(array.values[i + 1]);
    }
  };
  for (const View& view : views) {
    include(view.robot, 3);
    include(view.goal, 3);
    include(view.plan_base, 2);
    include(view.plan_hand, 2);
  }
  const double half = 0.5 * std::max(x.upper - x.lower, y.upper - y.lower) + kBorder_m;
  const double middle_x = 0.5 * (x.lower + x.upper), middle_y = 0.5 * (y.lower + y.upper);
  return {{middle_x - half, middle_x + half}, {middle_y - half, middle_y + half}, {}};
}

void draw_view(Canvas& canvas, const GroundView& ground, const View& view) {
  canvas.clip(ground.area);
  const auto spheres = [&](const StoredArray& array, const auto& draw) {
    for (std::size_t i = 0; i + 2 < array.values.size(); i += 3) {
      draw(ground.at(array.values[i], array.values[i + 1]), ground.scale() * array.values[i + 2]);
    }
  };
  for (const auto& [outline, moves] : view.objects) {
    const auto corners = ground.points(outline);
    canvas.polygon(corners, (moves ? palette::kVermilion : kObstacle).with_alpha(0.6));
  }
  spheres(view.goal, [&](const Point& at, double radius) {
    canvas.ring(at, radius, {palette::kGreen.with_alpha(0.35), 0.6, {}});
  });
  spheres(view.robot, [&](const Point& at, double radius) {
    canvas.circle(at, radius, palette::kSky.with_alpha(0.5));
  });
  canvas.line(ground.points(view.way_base), {palette::kBlack, 1.3, {}});
  canvas.line(ground.points(view.way_hand), {palette::kBlack, 0.8, {2.0, 2.0}});
  canvas.line(ground.points(view.plan_base), {palette::kBlue, 1.6, {}});
  canvas.line(ground.points(view.plan_hand), {palette::kBlue, 0.9, {2.0, 2.0}});
  canvas.unclip();
  canvas.outline(ground.area, {colour(0x777777), 0.7, {}});
}

Figure above_figure(const std::vector<View>& views, std::int64_t episode) {
  const int rows = (static_cast<int>(views.size()) + kColumns - 1) / kColumns;
  const double cell = kWidth / kColumns;
  const double legend = 30.0;
  const std::string name = std::to_string(episode);
  GroundView ground = ground_of(views);
  Figure figure{"episode-" + name + "-above",
                "Episode " + name + " from above; each picture is " +
                    format("%.1f m wide.", ground.x.upper - ground.x.lower),
                Canvas(kWidth, rows * (cell + kCaption) + legend)};
  for (std::size_t i = 0; i < views.size(); ++i) {
    const double left = cell * static_cast<double>(static_cast<int>(i) % kColumns);
    const double top = (cell + kCaption) * static_cast<double>(static_cast<int>(i) / kColumns);
    figure.canvas.text({left + 4.0, top + 14.0}, format("%.1f s", views[i].time_s),
                       {.size = 12.0, .bold = true});
    ground.area = {left + 3.0, top + kCaption, cell - 6.0, cell - 6.0};
    draw_view(figure.canvas, ground, views[i]);
  }
  using Mark = LegendEntry::Mark;
  draw_legend(figure.canvas, {4.0, figure.canvas.height() - 25.0}, kWidth,
              {{"moves", Mark::kBox, {palette::kVermilion, 1.0, {}}},
               {"stands", Mark::kBox, {kObstacle, 1.0, {}}},
               {"robot", Mark::kCircle, {palette::kSky, 1.0, {}}},
               {"goal", Mark::kCircle, {palette::kGreen, 1.0, {}}},
               {"way so far (hand dashed)", Mark::kLine, {palette::kBlack, 1.3, {}}},
               {"what is followed", Mark::kLine, {palette::kBlue, 1.6, {}}}});
  return figure;
}

/// What record_episode() stored of how near the robot came and how fast it went, with the contacts
/// of the episode; nothing where nothing was stored.
std::optional<Figure> course_figure(const StoredArray& course, std::int64_t episode,
                                    const Json& collisions) {
  if (course.rows < 2) return std::nullopt;
  constexpr double kHeight = 150.0, kLegend = 30.0;
  std::array<std::vector<double>, 4> columns;
  for (std::size_t i = 0; i < course.values.size(); ++i) {
    columns[i % 4].push_back(course.values[i]);
  }
  const auto& [time_s, clearance_m, base_mps, hand_mps] = columns;
  const std::string name = std::to_string(episode);
  Figure figure{
      "episode-" + name + "-course",
      "Episode " + name +
          ": distance from what truly was nearest, the floor aside, and speed of base and "
          "hand.",
      Canvas(kWidth, 2.0 * kHeight + kLegend)};
  const Range span{time_s.front(), time_s.back()};
  Range distance{0.0, 0.1};
  for (const double clearance : clearance_m) distance.include(clearance);
  Range speed{0.0, 0.01};
  for (const double mps : base_mps) speed.include(mps);
  for (const double mps : hand_mps) speed.include(mps);
  Axes above(figure.canvas, {90.0, 0.0, kWidth - 90.0, kHeight}, span, distance.padded(0.05),
             {"", "", "distance [m]"});
  Axes below(figure.canvas, {90.0, kHeight, kWidth - 90.0, kHeight}, span, speed.padded(0.05),
             {"", "time [s]", "speed [m/s]"});
  const Stroke own{palette::kVermilion, 1.4, {}}, others{palette::kOrange, 1.4, {}};
  for (Axes* const axes : {&above, &below}) {
    axes->grid();
    for (const Json& contact : collisions) {
      if (contact.at("episode") != episode) continue;
      axes->vertical(contact.at("time_s"), contact.at("by") == "robot" ? own : others);
    }
  }
  const Stroke nearest{palette::kGreen, 1.4, {}}, base{palette::kBlue, 1.4, {}},
      hand{palette::kSky, 1.0, {}};
  above.line(time_s, clearance_m, nearest);
  below.line(time_s, hand_mps, hand);
  below.line(time_s, base_mps, base);
  above.finish();
  below.finish();
  using Mark = LegendEntry::Mark;
  draw_legend(figure.canvas, {94.0, 2.0 * kHeight + 4.0}, kWidth - 94.0,
              {{"distance", Mark::kLine, nearest},
               {"base", Mark::kLine, base},
               {"hand", Mark::kLine, hand},
               {"contact by the robot", Mark::kLine, own},
               {"contact by others", Mark::kLine, others}});
  return figure;
}

Result<Figure> timeline_figure(ResultsReader& results, std::int64_t episode) {
  constexpr double kTimes = 190.0, kLane = 20.0;
  using Kind = ReplannerEvent::Kind;
  constexpr std::array kLanes = {std::pair(Kind::kPlanned, palette::kGreen),
                                 std::pair(Kind::kReplanned, palette::kBlue),
                                 std::pair(Kind::kReplanFailed, palette::kOrange),
                                 std::pair(Kind::kSlowed, palette::kSky),
                                 std::pair(Kind::kStopped, palette::kVermilion),
                                 std::pair(Kind::kRecovered, palette::kPurple),
                                 std::pair(Kind::kReached, palette::kBlack)};
  const std::string name = std::to_string(episode);
  Figure figure{
      "episode-" + name + "-time",
      "Episode " + name +
          " over time: what mapping took for each frame and planning for each attempt, and "
          "what the replanner did.",
      Canvas(kWidth, kTimes + kLane * kLanes.size() + 10.0)};
  const auto events = SIDESTEP_TRY(read_events(results, episode));
  const StoredArray mapping = array_of(results, "episode", episode, "mapping");
  const double begin_s = number_of(results, "episode", episode, "begin_s", 0.0);
  const double end_s =
      begin_s + std::max(1e-3, number_of(results, "episode", episode, "duration_s", 1.0));
  std::vector<double> mapped_s, mapping_ms;  // wall time of each frame
  for (int i = 0; i < mapping.rows; ++i) {
    const float* frame = mapping.values.data() + static_cast<std::ptrdiff_t>(i) * mapping.columns;
    mapped_s.push_back(frame[2]);
    mapping_ms.push_back(frame[3] + frame[4]);
  }
  double longest_ms = 1.0;
  for (const double took_ms : mapping_ms) longest_ms = std::max(longest_ms, took_ms);
  for (const auto& [item, event] : events) longest_ms = std::max(longest_ms, event.solve_ms);
  Axes axes(figure.canvas, {90.0, 0.0, kWidth - 90.0, kTimes}, {begin_s, end_s},
            {0.0, 1.08 * longest_ms}, {"", "time [s]", "mapping, planning [ms]"});
  axes.grid();
  axes.line(mapped_s, mapping_ms, {palette::kBlue, 1.1, {}});
  for (const auto& [item, event] : events) {
    if (event.solve_ms > 0.0) {
      figure.canvas.circle(axes.at(event.stamp.seconds(), event.solve_ms), 2.2, palette::kOrange);
    }
  }
  axes.finish();
  for (std::size_t lane = 0; lane < kLanes.size(); ++lane) {
    const double y = kTimes + kLane * (static_cast<double>(lane) + 0.5);
    const auto& [kind, its_colour] = kLanes[lane];
    figure.canvas.text({4.0, y + 4.0}, std::string(to_string(kind)), {.size = 11.0});
    const std::array line = {Point{axes.at(begin_s, 0.0).x, y}, Point{axes.at(end_s, 0.0).x, y}};
    figure.canvas.line(line, {palette::kPale, 1.0, {}});
    for (const auto& [item, event] : events) {
      if (event.kind == kind)
        figure.canvas.circle({axes.at(event.stamp.seconds(), 0.0).x, y}, 3.2, its_colour);
    }
  }
  return figure;
}

constexpr std::size_t kPicturedEpisodes = 6;

std::string collisions_section(const Json& summary) {
  const Json collisions = at(summary, "/collisions");
  if (!collisions.is_array() || collisions.empty()) return "";
  return "<h2>True collisions</h2>\n" + html_table({{"episode", "/episode"},
                                                    {"at", "/time_s", "%.2f s"},
                                                    {"by", "/by"},
                                                    {"link", "/link"},
                                                    {"object", "/object"},
                                                    {"depth", "/depth_m", "%.3f m"},
                                                    {"cause", "/cause"}},
                                                   collisions);
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
      {{"control steps", cell(at(summary, "/step_hz"), "%.0f Hz"), "250 Hz"},
       {"solve p50", cell(at(summary, "/solve_ms/p50"), "%.2f ms"), "at most 100 ms (10 Hz)"}});
}

/// How what was measured is spread over the run: cumulative shares, side by side; nothing where
/// there are not at least five values of anything.
Result<std::string> spread_section(ResultsReader& results, const std::filesystem::path& run) {
  constexpr std::size_t kEnough = 5;
  constexpr double kHeight = 260.0;
  std::vector<std::pair<std::string, std::vector<double>>> shown;  // labels, with units, and values
  for (const auto& [series, key, label] :
       {std::array{"event", "solve_ms", "solve, in vain or not [ms]"},
        std::array{"event", "stamp_to_trajectory_ms", "stamp to trajectory [ms]"},
        std::array{"episode", "duration_s", "time of an episode [s]"},
        std::array{"episode", "min_true_clearance_m", "least true clearance [m]"}}) {
    auto values = SIDESTEP_TRY(results.column(series, key));
    // Events without a solve have 0.
    std::erase_if(values, [](double value) { return !std::isfinite(value) || value == 0.0; });
    std::ranges::sort(values);
    if (values.size() >= kEnough) shown.emplace_back(label, std::move(values));
  }
  if (shown.empty()) return "";
  const double width = kWidth / static_cast<double>(shown.size());
  Canvas canvas(kWidth, kHeight);
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const auto& [label, values] = shown[i];
    Axes axes(canvas, {static_cast<double>(i) * width, 0.0, width, kHeight},
              Range{values.front(), values.back()}.padded(0.04), {0.0, 1.0},
              {"", label, i == 0 ? "share" : ""});
    axes.grid();
    std::vector<double> x{values.front()}, share{0.0};
    for (std::size_t k = 0; k < values.size(); ++k) {
      x.insert(x.end(), {values[k], values[k]});
      share.push_back(share.back());
      share.push_back(static_cast<double>(k + 1) / static_cast<double>(values.size()));
    }
    axes.line(x, share, {palette::kBlue, 1.6, {}});
    for (const double quantile : {0.5, 0.95}) {
      axes.vertical(percentile(values, quantile), {palette::kGrey, 1.0, {4.0, 3.0}});
    }
    axes.finish();
  }
  std::vector<Figure> figures;
  figures.push_back({"spread",
                     "How what was measured is spread: the share of measurements (up) that are at "
                     "most so large (right); dashed: p50 and p95.",
                     std::move(canvas)});
  return figure_section(figures, run);
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
    rows.push_back({format("%.3f s", event.stamp.seconds()), std::string(to_string(event.kind)),
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

std::string certificates_section(const Json& summary) {
  const Json share = at(summary, "/certified_share");
  if (!share.is_number()) return "";
  return "<p>Of the motions that were followed " + cell(share, report::kPercent) +
         " are proven to be clear of what the map held as they began, for as long as they were "
         "followed: <a href=\"certificates\">certificates</a>, for "
         "<code>sidestep_recheck</code>.</p>\n";
}

Result<std::string> replan_body(const Json& summary, ResultsReader& results,
                                const std::filesystem::path& run) {
  std::string html = replan_metrics().html(replan_metrics().rows_of(summary)) +
                     comparison_section(summary) + collisions_section(summary) +
                     certificates_section(summary) + failures_section(at(summary, "/failures"));
  if (!at(summary, "/episodes").is_number_integer()) return html;
  html += SIDESTEP_TRY(spread_section(results, run));
  const auto chosen = SIDESTEP_TRY(chosen_episodes(summary, results));
  for (const std::int64_t episode : chosen) {
    // As far as they were recorded: from above, distance and speed, and over time.
    std::vector<Figure> figures;
    const auto views = SIDESTEP_TRY(read_views(results, episode));
    if (!views.empty()) figures.push_back(above_figure(views, episode));
    auto course = course_figure(array_of(results, "episode", episode, "course"), episode,
                                at(summary, "/collisions"));
    if (course) figures.push_back(*std::move(course));
    figures.push_back(SIDESTEP_TRY(timeline_figure(results, episode)));
    html += "<h2>Episode " + std::to_string(episode) + "</h2>\n";
    html += SIDESTEP_TRY(figure_section(figures, run));
    html += SIDESTEP_TRY(events_section(results, episode));
  }
  return html;
}

}  // namespace

const report::RunReport& LoopExperiment::report() const {
  static const report::RunReport kReport = {
      .body = &replan_body, .columns = &replan_metrics(), .pictures = {"episode-", "spread."}};
  return kReport;
}

}  // namespace sidestep
