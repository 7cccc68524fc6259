#include <algorithm>
#include <cmath>

#include <sidestep/core/node.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/statistics.hpp>
#include <sidestep/results/summary.hpp>
#include "plan_parts.hpp"

namespace sidestep {
namespace {

using namespace report;

Json map_json(const MapRecord& map) {
  const auto times = [&](auto time) {
    const std::vector<double> values = values_of(map.steps, time);
    return Json{{"p50", percentile(values, 0.5)},
                {"p95", percentile(values, 0.95)},
                {"max", percentile(values, 1.0)}};
  };
  Json json = {{"frame_ms", times(&MappingStep::frame_ms)},
               {"read_ms", times(&MappingStep::read_ms)},
               {"integrate_ms", times(&MappingStep::integrate_ms)},
               {"field_ms", times(&MappingStep::field_ms)},
               {"occupied_vox", map.occupied_vox},
               {"known_vox", map.known_vox},
               {"empty_reason", map.empty_reason},
               {"left_out", map.left_out}};
  if (map.field) {
    const GridSpec& grid = map.field->info().grid;
    json["unknown_share"] =
        1.0 - static_cast<double>(map.known_vox) / static_cast<double>(grid.voxel_count());
    json["resolution_m"] = grid.resolution_m;
    json["size_vox"] = {grid.size_vox.x(), grid.size_vox.y(), grid.size_vox.z()};
    json["origin_m"] = {grid.origin_m.x(), grid.origin_m.y(), grid.origin_m.z()};
  }
  return json;
}

Json verdict_json(const std::optional<Verdict>& verdict) {
  if (!verdict) return nullptr;
  Json violations = Json::array();
  for (const Violation& violation : verdict->violations) {
    violations.push_back({{"kind", to_string(violation.kind)},
                          {"subject", violation.subject},
                          {"other", violation.other},
                          {"time_s", violation.time_s},
                          {"amount", violation.amount}});
  }
  return {{"outcome", to_string(verdict->outcome)},
          {"min_clearance_m", verdict->min_clearance_m},
          {"clearance_is_bound", verdict->clearance_is_bound},
          {"min_clearance_link", verdict->min_clearance_link},
          {"min_clearance_time_s", verdict->min_clearance_time_s},
          {"min_self_clearance_m", verdict->min_self_clearance_m},
          {"violations", violations}};
}

Json explanation_json(const std::optional<Explanation>& explanation) {
  if (!explanation) return nullptr;
  Json hindrances = Json::array();
  for (const Hindrance& h : explanation->hindrances) {
    Json obstacle_m;
    if (h.obstacle_m) obstacle_m = {h.obstacle_m->x(), h.obstacle_m->y(), h.obstacle_m->z()};
    hindrances.push_back({{"term", h.term},
                          {"what", h.what()},
                          {"broken", h.broken},
                          {"cost", h.cost},
                          {"share", h.share},
                          {"subject", h.subject},
                          {"other", h.other},
                          {"amount", h.amount},
                          {"unit", h.unit},
                          {"obstacle_m", std::move(obstacle_m)},
                          {"states", {h.first_state, h.last_state}},
                          {"from_s", h.from_s},
                          {"to_s", h.to_s},
                          {"worst_s", h.worst_s}});
  }
  return {{"cost", explanation->cost}, {"hindrances", std::move(hindrances)}};
}

Json plan_json(const PlanRecord& plan) {
  const Solution& solution = plan.solution;
  const std::optional<Verdict>& field = plan.field_verdict;
  const auto clearance_m = plan.min_clearance_m();
  const auto retiming = [&]() -> Json {
    if (!plan.retiming) return nullptr;
    return {{"before_s", plan.retiming->before_s},
            {"deviation", plan.retiming->deviation},
            {"retime_ms", plan.retiming->retime_ms}};
  };
  return {{"name", plan.name},
          {"attached", plan.attached},
          {"success", plan.success()},
          {"valid_snapshot", field && field->valid()},
          {"valid_independent", plan.valid_independent()},
          {"min_clearance_m", clearance_m ? Json(*clearance_m) : Json(nullptr)},
          {"clearance_is_bound", plan.clearance_is_bound()},
          {"duration_s", solution.trajectory.duration_s()},
          {"retiming", retiming()},
          {"solve_ms", solution.solve_ms},
          {"iterations", solution.iterations},
          {"cost", solution.cost},
          {"reason", plan.reason},
          {"explanation", explanation_json(solution.explanation)},
          {"status", plan.attempts > 0 ? Json(to_string(solution.status)) : Json(nullptr)},
          {"attempts", plan.attempts},
          {"certificate", plan.certified.empty() ? Json() : Json(plan.certified)},
          {"unknown_share", field ? Json(field->unknown_share) : Json(nullptr)},
          {"most_unknown_share", field ? Json(field->most_unknown_share) : Json(nullptr)},
          {"most_unknown_link", field ? Json(field->most_unknown_link) : Json(nullptr)},
          {"checks",
           {{"snapshot", verdict_json(field)},
            {"voxels", verdict_json(plan.voxel_verdict)},
            {"scene", verdict_json(plan.scene_verdict)}}}};
}

std::string count_of(std::size_t count, const std::string& thing) {
  return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
}

/// How much of the way nobody has seen, at most of any plan; empty where that is next to nothing.
std::string unseen_text(std::span<const PlanRecord> plans) {
  double share = 0.0;
  for (const PlanRecord& plan : plans) {
    if (plan.field_verdict) share = std::max(share, plan.field_verdict->unknown_share);
  }
  if (share < 0.005) return "";
  return std::string("; ") + (plans.size() == 1 ? "" : "of one ") +
         format("%.0f %%", 100.0 * share) +
         " of the robot's way is in space that no frame has seen or outside the map";
}

std::string verdict_text(const MapRecord& map, std::span<const PlanRecord> plans, bool interrupted,
                         std::size_t succeeded) {
  const std::string left_out = map.left_out.empty() ? "" : "; " + map.left_out;
  const std::string done =
      count_of(map.steps.size(), "frame") + " and " + count_of(plans.size(), "plan");
  if (interrupted) {
    return "Interrupted after " + done + "; what was measured is saved.";
  }
  if (map.fault) {
    return "Ended by a fault after " + done + ": " + map.fault->describe() +
           ". What was measured is saved.";
  }
  if (map.steps.empty()) {
    std::string text = "Failed: no frame could be mapped";
    if (!map.bad_frames.empty()) text += "; the first: " + map.bad_frames.front().describe();
    return text + ".";
  }
  if (!map.empty_reason.empty())
    return "Failed: the map is empty: " + map.empty_reason + left_out + ".";
  if (succeeded < plans.size()) {
    std::string text = "Failed: " + std::to_string(plans.size() - succeeded) + " of " +
                       count_of(plans.size(), "plan") + " did not succeed.";
    for (const PlanRecord& plan : plans) {
      if (!plan.success()) text += " " + plan.name + ": " + plan.reason + ".";
    }
    return text + (map.left_out.empty() ? "" : " What was mapped: " + map.left_out + ".");
  }
  const auto closest = std::ranges::min_element(plans, {}, &PlanRecord::min_clearance_m);
  std::string text = plans.size() == 1
                         ? "Success: plan '" + plans.front().name + "' passed every check"
                         : "Success: all " + count_of(plans.size(), "plan") + " passed every check";
  if (closest != plans.end() && std::isfinite(closest->min_clearance_m().value_or(INFINITY))) {
    const std::string clear = format("%.3f m", *closest->min_clearance_m());
    text += closest->clearance_is_bound()
                ? "; the robot is at least " + clear + " clear, as far as was looked"
                : "; the robot comes no closer than " + clear + " to an obstacle or the floor";
  }
  return text + unseen_text(plans) + left_out + ".";
}

const ResultColumns& plan_columns() {
  static const auto kColumns = [] {
    ResultColumns columns("/plans");
    columns.begin_table("Plans");
    columns.declare("name", "Name of the plan.", {.heading = "plan", .compared = true});
    columns.declare("success", "Whether it reaches its goal and passes every check.",
                    {.heading = "result", .pattern = "success|failed", .compared = true});
    columns.declare("valid_snapshot", "Whether the spheres are proven clear in the distance field.",
                    {.heading = "in field", .pattern = "valid|-"});
    columns.declare("valid_independent",
                    "Whether the independent checks of the shapes find nothing.",
                    {.heading = "independent", .pattern = "valid|-"});
    columns.declare("clearance_is_bound",
                    "Whether the least clearance is only as far as was looked.",
                    {.heading = "clear by", .pattern = "at least|exactly", .compared = true});
    columns.declare("min_clearance_m", "Least clearance that the checks found.",
                    {.heading = "clearance", .pattern = "%.3f m", .compared = true});
    columns.declare("retiming.before_s", "Duration of the motion that was optimised.",
                    {.heading = "optimised", .pattern = "%.2f s"});
    columns.declare("duration_s", "Duration of the motion as it was timed.",
                    {.heading = "duration", .pattern = "%.2f s", .compared = true});
    columns.declare("solve_ms", "Wall time in the optimiser, of all attempts.",
                    {.heading = "solve", .pattern = "%.1f ms", .compared = true});
    columns.declare("iterations", "Iterations of the last attempt.",
                    {.heading = "iterations", .compared = true});
    columns.declare("cost", "Its final cost.",
                    {.heading = "cost", .pattern = "%.4g", .page_only = true});
    columns.declare("attempts", "First guesses that were tried.", {.heading = "attempts"});
    columns.declare("certificate",
                    "`proven`: its certificate is in the run's folder `certificates`; `refuted`, "
                    "`undecided`: it has none. Null where none was asked for.");
    columns.declare("status", "How the optimiser ended.");
    columns.declare("reason", "Why the plan did not succeed.");
    columns.declare("unknown_share",
                    "Share of the checks of spheres in space that no frame has seen.");
    columns.declare("most_unknown_share", "That share of the link of which it is largest.");
    columns.declare("most_unknown_link", "That link.");
    columns.declare("attached", "Objects that the robot carries.");
    columns.declare("explanation", "What holds the motion where it is: terms, subjects, states.");
    columns.declare("checks",
                    "Verdicts of the checks `snapshot` (spheres in the field), `voxels` (shapes "
                    "among occupied voxels) and `scene` (shapes in the true scene).");
    return columns;
  }();
  return kColumns;
}

// The page of a run.

std::string map_section(const Json& summary) {
  std::string html =
      "<h2>Map</h2>\n" + html_table({{"frames", "/frames"},
                                     {"unusable", "/bad_frames"},
                                     {"frame time p50", "/map/frame_ms/p50", "%.1f ms"},
                                     {"p95", "/map/frame_ms/p95", "%.1f ms"},
                                     {"max", "/map/frame_ms/max", "%.1f ms"},
                                     {"occupied voxels", "/map/occupied_vox", "%.0f"},
                                     {"resolution", "/map/resolution_m", "%.3f m"}},
                                    Json::array({summary}));
  const Json errors = at(summary, "/bad_frame_errors");
  if (!errors.is_array() || errors.empty()) return html;
  html += "<details><summary>Unusable frames</summary><pre>";
  for (const Json& error : errors) html += escape_html(cell(error)) + "\n";
  return html + "</pre></details>\n";
}

/// Clearances as far as was looked say so.
std::string clearance_cell(const Json& of) {
  const std::string clear = cell(at(of, "/min_clearance_m"), "%.3f m");
  return at(of, "/clearance_is_bound") == Json(true) ? "at least " + clear : clear;
}

std::string checks_table(const Json& plan) {
  std::vector<Row> rows;
  for (const auto& [key, words] :
       {std::pair("snapshot", "spheres in the distance field"),
        {"voxels", "collision shapes among the occupied voxels"},
        {"scene", "collision shapes in the true scene, its floor included"}}) {
    const Json check = at(plan, ("/checks/" + std::string(key)).c_str());
    if (!check.is_object()) continue;
    rows.push_back({words, cell(at(check, "/outcome")), clearance_cell(check),
                    cell(at(check, "/min_clearance_link")),
                    cell(at(check, "/min_clearance_time_s"), "%.2f s"),
                    cell(at(check, "/min_self_clearance_m"), "%.3f m")});
  }
  if (rows.empty()) return "";
  return html_table({"check", "outcome", "clearance", "of", "at", "self-clearance"}, rows);
}

/// What holds a plan, in the order of its summary.
std::string explanation_section(const Json& plan) {
  const Json hindrances = at(plan, "/explanation/hindrances");
  if (!hindrances.is_array() || hindrances.empty()) return "";
  std::vector<Row> rows;
  for (const Json& hindrance : hindrances) {
    const Json first = at(hindrance, "/states/0"), last = at(hindrance, "/states/1");
    rows.push_back(
        {cell(at(hindrance, "/what")), cell(at(hindrance, "/broken")), cell(at(hindrance, "/term")),
         cell(at(hindrance, "/share"), kPercent), cell(at(hindrance, "/worst_s"), "%.2f s"),
         cell(at(hindrance, "/from_s"), "%.2f s") + " to " + cell(at(hindrance, "/to_s"), "%.2f s"),
         first == last ? cell(first) : cell(first) + " to " + cell(last)});
  }
  std::string html = "<h3>What holds it</h3>\n";
  html += html_table({"what", "broken", "cost term", "share of cost", "worst at", "felt", "states"},
                     rows);
  if (at(plan, "/retiming").is_object()) {
    html += "<p>Times and states are those of the optimised motion, before it was retimed.</p>\n";
  }
  return html;
}

/// Plans, one after the other, then the map that they were made in.
Result<std::string> plan_body(const Json& summary, ResultsReader& results,
                              const std::filesystem::path& run) {
  std::string html;
  const Json plans = at(summary, "/plans");
  if (plans.is_array() && !plans.empty()) html += plan_columns().html(plans);
  std::int64_t item = 0;
  for (const Json& plan : plans) {
    const std::string name = cell(at(plan, "/name"));
    html += "<h2>Plan " + escape_html(name) + "</h2>\n";
    if (const std::string reason = cell(at(plan, "/reason")); !reason.empty() && reason != "-") {
      html += "<p class=\"verdict failure\">" + escape_html(reason) + "</p>\n";
    }
    if (const Json attached = at(plan, "/attached"); attached.is_array() && !attached.empty()) {
      const auto names = joined(attached.get<std::vector<std::string>>());
      html += "<p>The robot carries: " + escape_html(names) + ".</p>\n";
    }
    html += explanation_section(plan);
    html += checks_table(plan);
    if (const Json certified = at(plan, "/certificate"); certified == Json("proven")) {
      const std::string file = escape_html(file_of("certificates", name, "json"));
      html += "<p>Proven over all of its time: <a href=\"" + file + "\">" + file +
              "</a>, for <code>sidestep_recheck</code>.</p>\n";
    } else if (certified.is_string()) {
      html += "<p class=\"verdict failure\">Not proven over all of its time: " +
              escape_html(cell(certified)) + ".</p>\n";
    }
    html += SIDESTEP_TRY(figure_section(SIDESTEP_TRY(plan_figures(results, item++, name)), run));
  }
  html += map_section(summary);
  return html + SIDESTEP_TRY(figure_section(SIDESTEP_TRY(map_figures(results)), run));
}

/// A run without a plan is a row, too.
Json plans_of(const Json& summary) {
  const Json plans = at(summary, "/plans");
  return plans.empty() ? Json::array({{{"success", false}}}) : plans;
}

}  // namespace

std::string file_of(const std::string& folder, std::string plan, const std::string& extension) {
  std::ranges::replace(plan, '/', '_');
  return folder + '/' + plan + '.' + extension;
}

std::optional<double> PlanRecord::min_clearance_m() const noexcept {
  std::optional<double> least;
  for (const auto* verdict : {&field_verdict, &voxel_verdict}) {
    if (!*verdict) continue;
    least = std::min(least.value_or((*verdict)->min_clearance_m), (*verdict)->min_clearance_m);
  }
  return least;
}

bool PlanRecord::clearance_is_bound() const noexcept {
  const auto least_m = min_clearance_m();
  const auto is_exact = [&](const std::optional<Verdict>& verdict) {
    return verdict && verdict->min_clearance_m == least_m && !verdict->clearance_is_bound;
  };
  return least_m && !is_exact(field_verdict) && !is_exact(voxel_verdict);
}

ExperimentOutcome summarise_plans(const RunProvenance& provenance, const MapRecord& map,
                                  std::span<const PlanRecord> plans) {
  ExperimentOutcome outcome;
  const auto succeeded =
      static_cast<std::size_t>(std::ranges::count_if(plans, &PlanRecord::success));
  outcome.interrupted = map.interrupted || std::ranges::any_of(plans, [](const auto& plan) {
                          return plan.interrupted;
                        });
  outcome.fault = map.fault;
  outcome.success = !outcome.interrupted && !outcome.fault && !map.steps.empty() &&
                    map.empty_reason.empty() && !plans.empty() && succeeded == plans.size();
  outcome.verdict = verdict_text(map, plans, outcome.interrupted, succeeded);
  Json bad_frames = Json::array();
  for (const Error& error : map.bad_frames) bad_frames.push_back(error.describe());
  Json plan_list = Json::array();
  for (const PlanRecord& plan : plans) plan_list.push_back(plan_json(plan));
  const Json particulars = {{"fault", map.fault ? Json(map.fault->describe()) : Json()},
                            {"frames", map.steps.size()},
                            {"bad_frames", map.bad_frames.size()},
                            {"bad_frame_errors", bad_frames},
                            {"map", map_json(map)},
                            {"plans", plan_list}};
  outcome.table = text_table({{"frames", "/frames", "%.0f"},
                              {"bad", "/bad_frames", "%.0f"},
                              {"frame p50", "/map/frame_ms/p50", "%.1f ms"},
                              {"frame p95", "/map/frame_ms/p95", "%.1f ms"},
                              {"frame max", "/map/frame_ms/max", "%.1f ms"},
                              {"occupied voxels", "/map/occupied_vox", "%.0f"}},
                             Json::array({particulars}));
  if (!plans.empty()) outcome.table += "\n" + plan_columns().text(plan_list);
  outcome.summary_json = summary_text(provenance, "plan", outcome, particulars);
  return outcome;
}

const report::RunReport& plan_report() {
  static const RunReport kReport = {
      .body = &plan_body,
      .columns = &plan_columns(),
      .compared_of_run = {{"frame p50", "/map/frame_ms/p50", "%.1f ms"}, {"frames", "/frames"}},
      .compared_rows = &plans_of,
      .pictures = {"plan-", "depth.", "frame_times."}};
  return kReport;
}

}  // namespace sidestep
