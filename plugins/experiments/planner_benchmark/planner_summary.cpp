#include "planner_summary.hpp"

#include <algorithm>
#include <set>

#include <sidestep/results/json.hpp>
#include <sidestep/results/summary_values.hpp>
#include "ompl_database.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

/// A planner on some problems.
struct PlannerRow {
  const PlannerRecord& planner;
  std::string family;
  std::vector<SetSolve> solves;
  std::vector<SetSolve> solved = those_of(solves, &SetSolve::is_solved);

  [[nodiscard]] std::size_t problems() const {
    std::set<std::int64_t> problems;
    for (const SetSolve& solve : solves) problems.insert(solve.problem);
    return problems.size();
  }
};

/// The share of a row's answers that are accepted and come within a limit.
auto solved_within(double limit_ms) {
  return [limit_ms](const PlannerRow& row) {
    return share_of(row.solves,
                    [&](const SetSolve& s) { return s.is_solved() && s.first_ms() <= limit_ms; });
  };
}

/// A number of each answer that is accepted.
template <class Value>
auto of_solved(Value value) {
  return [value](const PlannerRow& row) {
    return values_of(row.solved, [&](const SetSolve& s) { return std::invoke(value, s); });
  };
}

const report::ResultColumnsOf<PlannerRow>& planner_rows() {
  using R = PlannerRow;
  using S = SetSolve;
  static const auto kColumns =
      report::ResultColumnsOf<R>("/planners")
          .add("name", [](const R& r) { return r.planner.name; }, "Planner.",
               {.heading = "planner", .compared = true})
          .add("checker", [](const R& r) { return r.planner.checker; },
               "What checks its motions while it searches.",
               {.heading = "checker", .compared = true})
          .add("family", &R::family, "Family of problems, or `all`.", {.heading = "family"})
          .table("Answers",
                 "Solved: the independent check accepts the answer. Refused: it does not. First: "
                 "until the first valid answer; time: until the first one as smooth as the last.")
          .add("problems", &R::problems, "Problems it was given.")
          .add("answers", [](const R& r) { return r.solves.size(); },
               "Problems times seeds that have been tried.",
               {.heading = "answers", .pattern = "%.0f", .compared = true})
          .add("solved_share.s1", solved_within(1e3),
               "Share of the answers that come within 1 s and that the independent check accepts.",
               {.heading = "solved in 1 s", .pattern = "%.4f", .compared = true})
          .add("solved_share.s5", solved_within(5e3), "The same within 5 s.",
               {.heading = "in 5 s", .pattern = "%.4f"})
          .add("smooth_share",
               [](const R& r) {
                 return share_of(r.solves,
                                 [](const S& s) { return s.is_solved() && s.is_smooth(); });
               },
               "Share that is accepted and comes from an optimiser.",
               {.heading = "smooth", .pattern = "%.4f"})
          .spread("time_ms.", of_solved(&S::time_ms),
                  "Time until the first answer as smooth as the last one, of what is solved.",
                  {"p50", "p95"}, {.heading = "time", .pattern = "%.3f ms", .compared = true})
          .spread("first_valid_ms.", of_solved(&S::first_ms),
                  "Time until the first answer, of what is solved.", {"p50", "p95"},
                  {.heading = "first", .pattern = "%.3f ms"})
          .add("refused_by_check",
               [](const R& r) {
                 return std::ranges::count_if(r.solves,
                                              [](const S& s) { return !s.refusal.empty(); });
               },
               "Answers that the independent check refuses.",
               {.heading = "refused", .pattern = "%.0f", .compared = true})
          .table(
              "Motions",
              "Medians over what was solved. Acceleration: squared, over all joints and the whole "
              "motion, as a multiple of the least that one of its length and duration needs.")
          .spread("path_length_rad.", of_solved(&S::path_length),
                  "Length of the path in the space of joints, m and rad alike, of what is solved.",
                  {"p50"}, {.heading = "path", .pattern = "%.2f rad", .compared = true})
          .spread("duration_s.", of_solved(&S::duration_s),
                  "Duration of the motion, of what is solved.", {"p50"},
                  {.heading = "motion", .pattern = "%.2f s"})
          .spread("acceleration_ratio.", of_solved(&S::acceleration_ratio),
                  "Squared acceleration as a multiple of the least that a motion of its length and "
                  "duration needs, of what is solved.",
                  {"p50"}, {.heading = "acceleration", .pattern = "%.2f"})
          .spread("clearance_m.", of_solved(&S::clearance_m),
                  "Least clearance by the independent check, of what is solved.", {"p50"},
                  {.heading = "clearance", .pattern = "%.3f m"});
  return kColumns;
}

std::vector<std::string> families_of(const PlannerRecord& planner) {
  std::vector<std::string> families;
  for (const SetSolve& solve : planner.solves) {
    if (std::ranges::find(families, solve.family) == families.end())
      families.push_back(solve.family);
  }
  return families;
}

Json family_rows(const PlannerBenchmarkRecord& record) {
  Json rows = Json::array();
  for (const PlannerRecord& planner : record.planners) {
    for (const std::string& family : families_of(planner)) {
      const auto is_of_it = [&](const SetSolve& s) { return s.family == family; };
      rows.push_back(planner_rows().row({planner, family, those_of(planner.solves, is_of_it)}));
    }
  }
  return rows;
}

std::string verdict_text(const PlannerBenchmarkRecord& record, bool interrupted,
                         std::ptrdiff_t refused, const std::optional<Error>& fault) {
  const std::string of = " answers to the problems of " + record.problems;
  const std::string count =
      std::to_string(record.solved()) + " of " + std::to_string(record.planned()) + of;
  if (fault) return "Ended early, after " + count + ": " + fault->describe();
  if (interrupted) {
    return "Interrupted after " + count + "; what was measured is saved, --resume goes on.";
  }
  const std::string part =
      record.shard.is_whole() ? "" : "Shard " + shard_name(record.shard) + ": ";
  if (refused > 0) {
    return part + "Failed: the independent check refuses " + std::to_string(refused) + " of " +
           count + ".";
  }
  if (record.solved() < record.planned()) return part + "Incomplete: " + count + ".";
  return part + "Success: " + std::to_string(record.solved()) + of +
         ", none refused by the independent check.";
}

}  // namespace

ExperimentOutcome summarise_planners(const PlannerBenchmarkRecord& record, bool interrupted,
                                     const std::optional<Error>& fault) {
  Json planners = Json::array();
  std::ptrdiff_t refused = 0;
  for (const PlannerRecord& planner : record.planners) {
    planners.push_back(planner_rows().row({planner, "all", planner.solves}));
    refused += planners.back()["refused_by_check"].get<std::ptrdiff_t>();
  }
  const Json families = family_rows(record);
  const bool complete = record.solved() == record.planned();
  ExperimentOutcome outcome;
  outcome.fault = fault;
  outcome.interrupted = interrupted && !complete;
  outcome.success = complete && !fault && refused == 0;
  outcome.verdict = verdict_text(record, outcome.interrupted, refused, fault);
  Json rows = planners;
  for (const Json& family : families) rows.push_back(family);
  outcome.table = planner_rows().text(rows);
  outcome.table_csv = planner_rows().csv(rows);
  double wall_s = 0.0, cpu_s = 0.0;
  for (const RunSession& session : record.sessions) {
    wall_s += session.wall_s;
    cpu_s += session.cpu_s;
  }
  const Json shard = record.shard.is_whole()
                         ? Json(nullptr)
                         : Json{{"index", record.shard.index + 1}, {"count", record.shard.count}};
  outcome.summary_json = summary_text(
      record.provenance, "planner_benchmark", outcome,
      {{"fault", fault ? Json(fault->describe()) : Json(nullptr)},
       {"complete", complete},
       {"shard", shard},
       {"problems_file", record.problems},
       {"robot", record.robot},
       {"deadline_s", record.deadline_s},
       {"seeds", record.seeds},
       {"planners", planners},
       {"families", families},
       {"time", {{"sessions", record.sessions.size()}, {"wall_s", wall_s}, {"cpu_s", cpu_s}}}});
  return outcome;
}

const report::ResultColumns& planner_columns() { return planner_rows(); }

Result<ExperimentOutcome> conclude_planners(const std::filesystem::path& run, bool interrupted,
                                            const std::optional<Error>& fault) {
  const auto record = SIDESTEP_TRY(read_planner_record(run / "results.sqlite"));
  SIDESTEP_TRY(write_ompl_database(record, run / kOmplDatabase));
  return summarise_planners(record, interrupted, fault);
}

Result<ExperimentOutcome> merge_planners(const std::vector<std::filesystem::path>& runs,
                                         const std::filesystem::path& out) {
  auto whole = SIDESTEP_TRY(merged_record(runs, &read_planner_record, &absorb_planners));
  for (const std::filesystem::path& run : runs) {
    const auto part = read_planner_record(run / "results.sqlite");
    if (part && part->names == whole.names) continue;
    return fail(ErrorCode::kConfig, "this shard is of other problems than the first", run.string());
  }
  return conclude_whole(whole, out, &record_planners, &conclude_planners);
}

}  // namespace sidestep
