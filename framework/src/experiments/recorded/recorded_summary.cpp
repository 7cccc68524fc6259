#include "recorded/recorded_summary.hpp"

#include <algorithm>
#include <array>

#include "report/csv.hpp"
#include "report/report_parts.hpp"
#include "results/json.hpp"
#include "results/summary_values.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

Json spread_json(const std::vector<double>& values) {
  const Statistics s = statistics_of(values);
  if (values.empty()) return {{"mean", nullptr}, {"sd", nullptr}};
  return {{"mean", s.mean}, {"sd", s.sd}};
}

/// How often ours and the peer's are free, over some problems.
Json free_json(const std::vector<SolveRecord>& solves) {
  return {
      {"share", share_of(solves, &SolveRecord::is_free)},
      {"peer_share", share_of(solves, [](const SolveRecord& s) { return s.peer.free_exactly; })}};
}

/// Against the peer's: over the problems that are solved, but for the share, which is of all.
Json cost_json(const std::vector<SolveRecord>& solves, const std::vector<SolveRecord>& solved,
               bool comparable) {
  Json json = {{"share_within_1pct", nullptr},
               {"mean", nullptr},
               {"median", nullptr},
               {"peer_mean", nullptr},
               {"peer_median", nullptr}};
  if (solved.empty()) return json;
  const auto ours = values_of(solved, [](const SolveRecord& s) { return s.cost; });
  json["mean"] = statistics_of(ours).mean;
  json["median"] = percentile(ours, 0.5);
  if (!comparable) return json;
  const auto peers = values_of(solved, [](const SolveRecord& s) { return s.peer.final_cost; });
  json["share_within_1pct"] = share_of(solves, [](const SolveRecord& s) {
    return s.solved && s.cost <= kOnePercent * s.peer.final_cost;
  });
  json["peer_mean"] = statistics_of(peers).mean;
  json["peer_median"] = percentile(peers, 0.5);
  return json;
}

/// What the recording says of the peer's effort, over the same problems.
Json peer_json(const std::vector<SolveRecord>& solves) {
  std::vector<double> iterations, iteration_us;
  for (const SolveRecord& solve : solves) {
    if (solve.peer.iterations < 0) continue;  // not counted
    iterations.push_back(solve.peer.iterations);
    iteration_us.push_back(1e3 * solve.peer.optimise_ms / std::max(1, solve.peer.iterations));
  }
  return {{"lm_iteration_us", quantiles_json(iteration_us)},
          {"solve_ms", quantiles_and_mean_json(values_of(
                           solves, [](const SolveRecord& s) { return s.peer.total_ms; }))},
          {"iterations", spread_json(iterations)}};
}

Json run_json(const RecordedRunRecord& run, bool comparable) {
  const auto solved = those_of(run.solves, &SolveRecord::solved);
  const auto with_free_ends = those_of(run.solves, &SolveRecord::ends_free);
  Json free_ends = {{"problems", with_free_ends.size()}};
  free_ends.update(free_json(with_free_ends));
  return {
      {"label", run.label},
      {"field", run.is_signed ? "sdf" : "usdf"},
      {"relative_tolerance", run.relative_tolerance},
      {"max_iterations", run.max_iterations},
      {"problems", run.solves.size()},
      {"solved", solved.size()},
      {"lm_iteration_us",
       quantiles_json(values_of(solved, [](const SolveRecord& s) { return s.iteration_us(); }))},
      {"solve_ms",
       quantiles_and_mean_json(values_of(solved, [](const SolveRecord& s) { return s.solve_ms; }))},
      {"iterations",
       spread_json(values_of(solved, [](const SolveRecord& s) { return s.accepted_iterations; }))},
      {"cost", cost_json(run.solves, solved, comparable)},
      {"collision_free", free_json(run.solves)},
      {"free_ends", free_ends},
      {"free_at_checks",
       {{"share", share_of(run.solves, &SolveRecord::free_at_checks)},
        {"peer_share",
         share_of(run.solves, [](const SolveRecord& s) { return s.peer.free_at_checks; })}}},
      {"peer", peer_json(run.solves)}};
}

std::string table_text(const Json& runs) {
  const report::Columns times = {{"run", "/label"},
                                 {"field", "/field"},
                                 {"problems", "/problems", "%.0f"},
                                 {"iteration p50", "/lm_iteration_us/p50", "%.1f us"},
                                 {"p95", "/lm_iteration_us/p95", "%.1f us"},
                                 {"solve p50", "/solve_ms/p50", "%.4f ms"},
                                 {"p95", "/solve_ms/p95", "%.4f ms"},
                                 {"mean", "/solve_ms/mean", "%.4f ms"},
                                 {"iterations", "/iterations/mean", "%.2f"},
                                 {"sd", "/iterations/sd", "%.2f"},
                                 {"peer's solve p50", "/peer/solve_ms/p50", "%.2f ms"},
                                 {"iterations", "/peer/iterations/mean", "%.2f"}};
  const report::Columns results = {{"run", "/label"},
                                   {"field", "/field"},
                                   {"within 1 %", "/cost/share_within_1pct", "%.4f"},
                                   {"mean cost", "/cost/mean", "%.6g"},
                                   {"peer's", "/cost/peer_mean", "%.6g"},
                                   {"median cost", "/cost/median", "%.6g"},
                                   {"peer's", "/cost/peer_median", "%.6g"},
                                   {"collision-free", "/collision_free/share", "%.4f"},
                                   {"peer's", "/collision_free/peer_share", "%.4f"},
                                   {"ends free", "/free_ends/problems", "%.0f"},
                                   {"of them", "/free_ends/share", "%.4f"},
                                   {"peer's", "/free_ends/peer_share", "%.4f"}};
  return report::text_table(times, runs) + "\n" + report::text_table(results, runs);
}

std::string table_csv(const Json& runs) {
  constexpr std::array kColumns = {"/label",
                                   "/field",
                                   "/problems",
                                   "/solved",
                                   "/lm_iteration_us/p50",
                                   "/lm_iteration_us/p95",
                                   "/solve_ms/p50",
                                   "/solve_ms/p95",
                                   "/solve_ms/mean",
                                   "/iterations/mean",
                                   "/iterations/sd",
                                   "/cost/share_within_1pct",
                                   "/cost/mean",
                                   "/cost/median",
                                   "/cost/peer_mean",
                                   "/cost/peer_median",
                                   "/collision_free/share",
                                   "/collision_free/peer_share",
                                   "/free_ends/problems",
                                   "/free_ends/share",
                                   "/free_ends/peer_share",
                                   "/free_at_checks/share",
                                   "/free_at_checks/peer_share",
                                   "/peer/lm_iteration_us/p50",
                                   "/peer/solve_ms/p50",
                                   "/peer/solve_ms/p95",
                                   "/peer/iterations/mean"};
  return csv_text(runs, kColumns);
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
    runs.push_back(run_json(run, record.costs_comparable));
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
  outcome.table = table_text(runs);
  outcome.table_csv = table_csv(runs);
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
