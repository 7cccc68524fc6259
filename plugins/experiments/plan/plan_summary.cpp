#include "plan_summary.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include <sidestep/report/text_table.hpp>
#include <sidestep/results/json.hpp>
#include <sidestep/results/statistics.hpp>

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

Json times(const std::vector<double>& values) {
  return {{"p50", percentile(values, 0.5)},
          {"p95", percentile(values, 0.95)},
          {"max", percentile(values, 1.0)}};
}

Json map_json(const MapRecord& map) {
  std::vector<double> frame, read, integrate, field;
  for (const MappingStep& step : map.steps) {
    frame.push_back(step.frame_ms());
    read.push_back(step.read_ms);
    integrate.push_back(step.integrate_ms);
    field.push_back(step.field_ms);
  }
  Json json = {{"frame_ms", times(frame)},         {"read_ms", times(read)},
               {"integrate_ms", times(integrate)}, {"field_ms", times(field)},
               {"occupied_vox", map.occupied_vox}, {"known_vox", map.known_vox},
               {"empty_reason", map.empty_reason}, {"left_out", map.left_out}};
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

Json retiming_json(const std::optional<RetimingRecord>& retiming) {
  if (!retiming) return nullptr;
  return {{"before_s", retiming->before_s},
          {"deviation", retiming->deviation},
          {"retime_ms", retiming->retime_ms}};
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
  const auto clearance_m = plan.min_clearance_m();
  return {
      {"name", plan.name},
      {"attached", plan.attached},
      {"success", plan.success()},
      {"valid_snapshot", plan.in_snapshot && plan.in_snapshot->valid()},
      {"valid_independent", plan.valid_independent()},
      {"min_clearance_m", clearance_m ? Json(*clearance_m) : Json(nullptr)},
      {"clearance_is_bound", plan.clearance_is_bound()},
      {"duration_s", solution.trajectory.duration_s()},
      {"retiming", retiming_json(plan.retiming)},
      {"solve_ms", solution.solve_ms},
      {"iterations", solution.iterations},
      {"cost", solution.cost},
      {"reason", plan.reason},
      {"explanation", explanation_json(solution.explanation)},
      {"status", plan.attempts > 0 ? Json(to_string(solution.status)) : Json(nullptr)},
      {"attempts", plan.attempts},
      {"unknown_share", plan.in_snapshot ? Json(plan.in_snapshot->unknown_share) : Json(nullptr)},
      {"most_unknown_share",
       plan.in_snapshot ? Json(plan.in_snapshot->most_unknown_share) : Json(nullptr)},
      {"most_unknown_link",
       plan.in_snapshot ? Json(plan.in_snapshot->most_unknown_link) : Json(nullptr)},
      {"checks",
       {{"snapshot", verdict_json(plan.in_snapshot)},
        {"voxels", verdict_json(plan.in_voxels)},
        {"scene", verdict_json(plan.in_scene)}}}};
}

std::string count_of(std::size_t count, const std::string& thing) {
  return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
}

/// How much of the way nobody has seen, at most of any plan; empty where that is next to nothing.
std::string unseen_text(std::span<const PlanRecord> plans) {
  double share = 0.0;
  for (const PlanRecord& plan : plans) {
    if (plan.in_snapshot) share = std::max(share, plan.in_snapshot->unknown_share);
  }
  if (share < 0.005) return "";
  return std::string("; ") + (plans.size() == 1 ? "" : "of one ") +
         format("%.0f %%", 100.0 * share) +
         " of the robot's way is in space that no frame has seen or outside the map";
}

std::string verdict_text(const MapRecord& map, std::span<const PlanRecord> plans, bool interrupted,
                         std::size_t succeeded) {
  const std::string left_out = map.left_out.empty() ? "" : "; " + map.left_out;
  if (interrupted) {
    return "Interrupted after " + count_of(map.steps.size(), "frame") + " and " +
           count_of(plans.size(), "plan") + "; what was measured is saved.";
  }
  if (map.fault) {
    return "Ended by a fault after " + count_of(map.steps.size(), "frame") + " and " +
           count_of(plans.size(), "plan") + ": " + map.fault->describe() +
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
  const PlanRecord* closest = nullptr;
  for (const PlanRecord& plan : plans) {
    if (closest == nullptr || plan.min_clearance_m() < closest->min_clearance_m()) closest = &plan;
  }
  std::string text = plans.size() == 1
                         ? "Success: plan '" + plans.front().name + "' passed every check"
                         : "Success: all " + count_of(plans.size(), "plan") + " passed every check";
  if (closest != nullptr && std::isfinite(closest->min_clearance_m().value_or(INFINITY))) {
    const std::string clear = format("%.3f m", *closest->min_clearance_m());
    text += closest->clearance_is_bound()
                ? "; the robot is at least " + clear + " clear, as far as was looked"
                : "; the robot comes no closer than " + clear + " to an obstacle or the floor";
  }
  return text + unseen_text(plans) + left_out + ".";
}

std::string table_text(const MapRecord& map, const Json& plans) {
  std::vector<double> frame_ms;
  for (const MappingStep& step : map.steps) frame_ms.push_back(step.frame_ms());
  TextTable map_table({"frames", "bad", "frame p50", "frame p95", "frame max", "occupied voxels"});
  map_table.add({std::to_string(map.steps.size()), std::to_string(map.bad_frames.size()),
                 format("%.1f ms", percentile(frame_ms, 0.5)),
                 format("%.1f ms", percentile(frame_ms, 0.95)),
                 format("%.1f ms", percentile(frame_ms, 1.0)), std::to_string(map.occupied_vox)});
  return map_table.text() + (plans.empty() ? "" : "\n" + plan_columns().text(plans));
}

}  // namespace

const report::ResultColumns& plan_columns() {
  static const auto kColumns = [] {
    report::ResultColumns columns("/plans");
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

std::optional<double> PlanRecord::min_clearance_m() const noexcept {
  std::optional<double> least;
  for (const auto* verdict : {&in_snapshot, &in_voxels}) {
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
  return least_m && !is_exact(in_snapshot) && !is_exact(in_voxels);
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
  outcome.table = table_text(map, plan_list);
  outcome.summary_json = summary_text(provenance, "plan", outcome,
                                      {{"fault", map.fault ? Json(map.fault->describe()) : Json()},
                                       {"frames", map.steps.size()},
                                       {"bad_frames", map.bad_frames.size()},
                                       {"bad_frame_errors", bad_frames},
                                       {"map", map_json(map)},
                                       {"plans", plan_list}});
  return outcome;
}

}  // namespace sidestep
