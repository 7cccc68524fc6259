#include "recorded_summary.hpp"

#include <algorithm>

#include <sidestep/results/json.hpp>
#include <sidestep/results/summary_values.hpp>

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

/// One recorded run. Costs and times are of the problems that are solved.
struct RunRow {
  const RecordedRunRecord& run;
  bool costs_comparable;
  std::vector<SolveRecord> solved = those_of(run.solves, &SolveRecord::solved);
  std::vector<SolveRecord> with_free_ends = those_of(run.solves, &SolveRecord::ends_free);
  /// Of which the recording counts the peer's iterations.
  std::vector<SolveRecord> counted =
      those_of(run.solves, [](const SolveRecord& s) { return s.peer.iterations >= 0; });
};

template <class Value>
auto of_solved_problems(Value value) {
  return [value](const RunRow& row) {
    return values_of(row.solved, [&](const SolveRecord& s) { return std::invoke(value, s); });
  };
}

/// The same where ours and the peer's costs are measured alike; nothing where they are not.
template <class Value>
auto where_comparable(Value value) {
  return [value](const RunRow& row) {
    return row.costs_comparable ? of_solved_problems(value)(row) : std::vector<double>();
  };
}

double peer_cost(const SolveRecord& s) { return s.peer.final_cost; }
bool is_peer_free(const SolveRecord& s) { return s.peer.free_exactly; }

template <class Holds>
auto share_of_all(Holds holds) {
  return [holds](const RunRow& row) { return share_of(row.run.solves, holds); };
}
template <class Holds>
auto share_with_free_ends(Holds holds) {
  return [holds](const RunRow& row) { return share_of(row.with_free_ends, holds); };
}

Json share_no_costlier(const RunRow& row) {
  if (!row.costs_comparable || row.solved.empty()) return nullptr;
  return share_of(row.run.solves, [](const SolveRecord& s) {
    return s.solved && s.cost <= kOnePercent * s.peer.final_cost;
  });
}

/// Of the peer's over the problems whose iterations are known.
template <class Value>
auto of_peer(Value value) {
  return [value](const RunRow& row) { return values_of(row.counted, value); };
}

const report::ResultColumnsOf<RunRow>& recorded_runs() {
  using R = RunRow;
  using S = SolveRecord;
  static const auto kColumns =
      report::ResultColumnsOf<R>("/runs")
          .add("label", [](const R& r) { return r.run.label; }, "Run of the recording.",
               {.heading = "rules", .compared = true})
          .add("field", [](const R& r) { return r.run.is_signed ? "sdf" : "usdf"; },
               "Kind of field: `sdf` or `usdf`.", {.heading = "field", .compared = true})
          .table("Time",
                 "An iteration is an accepted step with the damping attempts before it. The peer's "
                 "times are those that were recorded, on its machine.")
          .add(
              "relative_tolerance", [](const R& r) { return r.run.relative_tolerance; },
              "Relative decrease of the cost at which a solve ends.")
          .add(
              "max_iterations", [](const R& r) { return r.run.max_iterations; },
              "Iterations at which it ends.")
          .add("problems", [](const R& r) { return r.run.solves.size(); }, "Problems of the run.",
               {.heading = "problems", .pattern = "%.0f"})
          .add("solved", [](const R& r) { return r.solved.size(); }, "Problems with a trajectory.",
               {.heading = "solved", .pattern = "%.0f"})
          .spread("lm_iteration_us.", of_solved_problems(&S::iteration_us),
                  "Wall time of an accepted iteration.", {"p50", "p95"},
                  {.heading = "iteration", .pattern = "%.1f us", .compared = true})
          .spread("solve_ms.", of_solved_problems(&S::solve_ms), "Wall time of a solve.",
                  {"p50", "p95", "mean"},
                  {.heading = "solve", .pattern = "%.4f ms", .compared = true})
          .spread("iterations.", of_solved_problems(&S::accepted_iterations),
                  "Accepted iterations.", {"mean", "sd"},
                  {.heading = "iterations", .pattern = "%.2f", .compared = true})
          .spread("peer.lm_iteration_us.", of_peer([](const S& s) {
                    return 1e3 * s.peer.optimise_ms / std::max(1, s.peer.iterations);
                  }),
                  "The peer's, as recorded.", {"p50", "p95"},
                  {.heading = "peer's iteration", .pattern = "%.0f us", .page_only = true})
          .spread("peer.solve_ms.",
                  [](const R& r) {
                    return values_of(r.run.solves, [](const S& s) { return s.peer.total_ms; });
                  },
                  "The peer's, as recorded.", {"p50", "p95", "mean"},
                  {.heading = "peer's solve", .pattern = "%.2f ms", .page_only = true})
          .spread("peer.iterations.", of_peer([](const S& s) { return s.peer.iterations; }),
                  "The peer's, as recorded.", {"mean", "sd"},
                  {.heading = "peer's iterations", .pattern = "%.2f", .page_only = true})
          .table("Costs and collisions")
          .add("cost.share_within_1pct", &share_no_costlier,
               "Share of all problems that cost at most 1 % more than the peer's.",
               {.heading = "within 1 % or below", .pattern = "%.4f", .compared = true})
          .spread("cost.", of_solved_problems(&S::cost), "Final cost.", {"mean", "median"},
                  {.heading = "cost", .pattern = "%.6g"})
          .spread("cost.peer_", where_comparable(&peer_cost), "The peer's, as recorded.",
                  {"mean", "median"}, {.heading = "peer's cost", .pattern = "%.6g"})
          .add("collision_free.share", share_of_all(&S::is_free),
               "Share of all problems with a trajectory free of collisions, by exact distances.",
               {.heading = "collision-free", .pattern = "%.4f", .compared = true})
          .add("collision_free.peer_share", share_of_all(&is_peer_free), "The peer's.",
               {.heading = "peer's", .pattern = "%.4f"})
          .add("free_ends.problems", [](const R& r) { return r.with_free_ends.size(); },
               "Problems whose start and goal touch nothing.",
               {.heading = "ends free", .pattern = "%.0f"})
          .add("free_ends.share", share_with_free_ends(&S::is_free),
               "Share of these that is free of collisions.",
               {.heading = "of them free", .pattern = "%.4f"})
          .add("free_ends.peer_share", share_with_free_ends(&is_peer_free), "The peer's.",
               {.heading = "peer's", .pattern = "%.4f"})
          .add("free_at_checks.share", share_of_all(&S::free_at_checks),
               "Share that is free at the states that the peer checks.",
               {.heading = "free at the checked states", .pattern = "%.4f", .page_only = true})
          .add("free_at_checks.peer_share",
               share_of_all([](const S& s) { return s.peer.free_at_checks; }), "The peer's.",
               {.heading = "peer's", .pattern = "%.4f", .page_only = true});
  return kColumns;
}

std::string verdict_text(const RecordedBenchmarkRecord& record, std::size_t solves,
                         std::size_t unsolved, const std::string& first_reason) {
  const std::string count = std::to_string(solves) + " solves by " + record.about.optimiser;
  if (record.interrupted) return "Interrupted after " + count + "; what was measured is saved.";
  const std::string note = record.costs_comparable
                               ? ""
                               : " The peer's state is a Lie group here: costs are not comparable.";
  if (unsolved > 0) {
    return "Failed: " + std::to_string(unsolved) + " of " + count +
           " came to nothing, the first because: " + first_reason + "." + note;
  }
  return "Success: " + count + " on the problems of " + record.about.problems_file +
         ", each with a " + "trajectory." + note;
}

}  // namespace

const report::ResultColumns& recorded_columns() { return recorded_runs(); }

double SolveRecord::iteration_us() const noexcept {
  return 1e3 * solve_ms / std::max(1, accepted_iterations);
}

ExperimentOutcome summarise_recorded(const RunProvenance& provenance,
                                     const RecordedBenchmarkSettings& settings,
                                     const RecordedBenchmarkRecord& record) {
  Json runs = Json::array();
  std::size_t solves = 0, unsolved = 0, problems = 0;
  std::string first_reason;
  for (const RecordedRunRecord& run : record.runs) {
    runs.push_back(recorded_runs().row({run, record.costs_comparable}));
    problems = std::max(problems, run.solves.size());
    for (const SolveRecord& solve : run.solves) {
      ++solves;
      if (solve.solved) continue;
      if (unsolved++ == 0) first_reason = solve.reason;
    }
  }
  ExperimentOutcome outcome;
  outcome.interrupted = record.interrupted;
  outcome.success = !record.interrupted && solves > 0 && unsolved == 0;
  outcome.verdict = verdict_text(record, solves, unsolved, first_reason);
  outcome.table = recorded_runs().text(runs);
  outcome.table_csv = recorded_runs().csv(runs);
  outcome.summary_json = summary_text(provenance, settings.type, outcome,
                                      {{"problems_file", record.about.problems_file},
                                       {"robot", record.about.robot},
                                       {"optimiser", record.about.optimiser},
                                       {"costs_comparable", record.costs_comparable},
                                       {"repeats", settings.repeats},
                                       {"problems", problems},
                                       {"runs", runs}});
  return outcome;
}

}  // namespace sidestep
