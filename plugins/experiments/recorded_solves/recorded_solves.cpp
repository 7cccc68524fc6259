#include "recorded_solves.hpp"

#include <algorithm>
#include <array>

#include <sidestep/core/index.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/runtime/blocks.hpp>

namespace sidestep {
namespace {

/// Leaves every n-th outcome, and of those as many as are wanted.
void thin_out(std::vector<RecordedOutcome>& outcomes, const ProblemChoice& choice) {
  std::vector<RecordedOutcome> kept;
  for (std::size_t i = 0; i < outcomes.size(); i += idx(choice.every)) {
    if (choice.limit == 0 || std::ssize(kept) < choice.limit) kept.push_back(outcomes[i]);
  }
  outcomes = std::move(kept);
}

/// A mistake for each label that no run has.
void check_labels(const Node& experiment, const ProblemChoice& choice,
                  const RecordedProblems& problems, std::vector<Error>& errors) {
  std::vector<std::string> labels;
  for (const RecordedRun& run : problems.runs) {
    if (std::ranges::find(labels, run.label) == labels.end()) labels.push_back(run.label);
  }
  const Node* written = experiment.find("runs");
  for (std::size_t i = 0; i < choice.runs.size(); ++i) {
    const std::string& label = choice.runs[i];
    if (std::ranges::find(labels, label) != labels.end()) continue;
    const bool has_mark = written != nullptr && i < written->items().size();
    const Node& node = has_mark ? written->items()[i] : experiment;
    errors.push_back(node.error(
        "no run in " + problems.file.string() + " is labelled '" + label + "'",
        did_you_mean(label, labels, "there are: " + (labels.empty() ? "none" : joined(labels)))));
  }
}

}  // namespace

Node block_for(const Node& optimiser, const RecordedRun& run) {
  const SourceMark mark{"recorded run " + run.label, 0, 0};
  Node block = with_entry(optimiser, "relative_tolerance",
                          plain_scalar(detail::number_text(run.relative_tolerance), mark));
  return with_entry(std::move(block), "max_iterations",
                    plain_scalar(std::to_string(run.max_iterations), mark));
}

void check_optimiser(const Configuration& configuration, const std::vector<std::string>& names,
                     Host& host, std::vector<Error>& errors) {
  const Node& optimiser = block_of(configuration, "optimiser");
  const auto plugin = host.find(PluginKind::kOptimiser, optimiser);
  if (!plugin) return;  // told of where plugins are checked
  for (const std::string& name : names) {
    if (const Node* written = optimiser.find(name)) {
      errors.push_back(written->error(
          "'" + name + "' is set by the experiment, to that of each run", "leave it out"));
    }
    if (!has_parameter(plugin->schema, name)) {
      errors.push_back(optimiser.error("the optimiser '" + plugin->name + "' has no parameter '" +
                                       name + "', which the experiment must set"));
    }
  }
}

RecordedProblems read_chosen_problems(const Node& experiment, const ProblemChoice& choice,
                                      std::vector<Error>& errors) {
  const Node* written = experiment.find("problems");
  auto problems = read_recorded_problems(choice.problems);
  if (!problems) {
    const Node& node = written != nullptr ? *written : experiment;
    errors.push_back(problems.error().wrapped(
        ErrorCode::kConfig, "the recorded problems cannot be used", node.mark().to_string()));
    return {};
  }
  check_labels(experiment, choice, *problems, errors);
  std::erase_if(problems->runs, [&](const RecordedRun& run) {
    return std::ranges::find(choice.runs, run.label) == choice.runs.end();
  });
  for (RecordedRun& run : problems->runs) thin_out(run.outcomes, choice);
  const bool any = std::ranges::any_of(
      problems->runs, [](const RecordedRun& run) { return !run.outcomes.empty(); });
  if (!any) errors.push_back(experiment.error("there is no problem to solve"));
  return std::move(*problems);
}

Result<RecordedStart> start_recorded(const ExperimentContext& context,
                                     const ProblemChoice& choice) {
  const Node& experiment = block_of(context.configuration, "experiment");
  if (choice.problems.empty()) {
    return tl::make_unexpected(
        experiment.error("there is no file of recorded problems",
                         "say where they are: --set experiment.problems=FILE"));
  }
  std::vector<Error> errors;
  auto problems = read_chosen_problems(experiment, choice, errors);
  if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
  const RunProvenance provenance = provenance_of(context);
  auto store = SIDESTEP_TRY(ResultsStore::open(context.out / "results.sqlite", provenance));
  const Node& optimiser = block_of(context.configuration, "optimiser");
  const Node* const prior = optimiser.find("base_prior");
  return RecordedStart{std::move(problems), optimiser.find("plugin")->text(),
                       prior != nullptr && prior->text() == "body", provenance, std::move(store)};
}

TimedSolve solve_timed(PluginPtr<Optimiser>& optimiser, const Problem& problem,
                       const Trajectory& initial, const ExperimentContext& context) {
  const Stopwatch watch;
  auto solution = call_plugin(plugin_of(optimiser), [&] {
    return optimiser->solve(problem, initial, Deadline(context.stop));
  });
  return {std::move(solution), watch.elapsed_ms()};
}

void note(const TimedSolve& timed, bool is_first, RecordedSolve& record) {
  record.solve_ms = is_first ? timed.elapsed_ms : std::min(record.solve_ms, timed.elapsed_ms);
  if (!is_first) return;
  if (!timed.solution) {
    record.reason = timed.solution.error().describe();
    return;
  }
  const Solution& solution = *timed.solution;
  record.solved = solution.trajectory.size() > 0;
  record.status = solution.status;
  record.reason = solution.reason;
  record.iterations = solution.iterations;
  record.accepted_iterations = solution.accepted_iterations;
  record.initial_cost = solution.initial_cost;
  record.cost = solution.cost;
}

void record_solve(const RecordedSolve& solve, std::string_view series, std::int64_t item,
                  Recorder& recorder) {
  const auto add = [&](std::string_view key, const auto& value) {
    recorder.add(series, item, key, value);
  };
  add("status", to_string(solve.status));
  if (!solve.reason.empty()) add("reason", solve.reason);
  add("solve_ms", solve.solve_ms);
  add("iterations", solve.iterations);
  add("accepted_iterations", solve.accepted_iterations);
  add("initial_cost", solve.initial_cost);
  add("cost", solve.cost);
  add("exact_clearance_m", solve.exact_clearance_m);
}

bool are_ends_free(const RecordedProblems& problems, int scene, const Problem& problem) {
  return std::ranges::all_of(std::array{&problem.start.q, &problem.goal.q}, [&](const auto* q) {
    return exact_clearance_m(problems, scene, as_span(*q)) > 0.0;
  });
}

std::string SolveCount::failure(const std::string& what, const char* came_to) const {
  const std::string count = std::to_string(problems) + " " + what;
  if (interrupted) return "Interrupted after " + count + "; what was measured is saved.";
  if (unsolved == 0) return "";
  return "Failed: " + std::to_string(unsolved) + " of " + count + " " + came_to +
         ", the first because: " + first_reason + ".";
}

ExperimentOutcome summarise_solves(const RecordedStart& start, const std::string& experiment,
                                   const SolveCount& count, std::string verdict,
                                   const report::ResultColumns& columns,
                                   const nlohmann::ordered_json& particulars) {
  const nlohmann::ordered_json& rows = particulars.back();
  ExperimentOutcome outcome;
  outcome.interrupted = count.interrupted;
  outcome.success = !count.interrupted && count.problems > 0 && count.unsolved == 0;
  outcome.verdict = std::move(verdict);
  outcome.table = columns.text(rows);
  outcome.table_csv = columns.csv(rows);
  nlohmann::ordered_json all = {{"problems_file", start.problems.file.filename().string()},
                                {"robot", start.problems.robot->description().name},
                                {"optimiser", start.optimiser}};
  all.update(particulars);
  outcome.summary_json = summary_text(start.provenance, experiment, outcome, all);
  return outcome;
}

std::string sentence_of(const nlohmann::ordered_json& summary) {
  const auto text = [&](const char* pointer) {
    return escape_html(report::cell(report::at(summary, pointer)));
  };
  return "<p>" + text("/optimiser") + " on the problems of " + text("/problems_file") + ", robot " +
         text("/robot");
}

}  // namespace sidestep
