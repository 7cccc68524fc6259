#include "recorded_solves.hpp"

#include <algorithm>
#include <array>

#include <sidestep/core/file.hpp>
#include <sidestep/core/format.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/runtime/blocks.hpp>

namespace sidestep {
namespace {

constexpr const char* kHead = "benchmark";

StoredRow<RecordedHead> stored_head() {
  using Head = RecordedHead;
  return StoredRow<Head>()
      .add("problems_file", &Head::problems_file)
      .add("robot", &Head::robot)
      .add("optimiser", &Head::optimiser)
      .add("repeats", &Head::repeats)
      .add("about", &Head::about)
      .add(
          "series", [](const Head& head) { return head.series.size(); },
          [](Head& head, std::size_t count) { head.series.resize(count); });
}

StoredRow<RecordedSeries> stored_series() {
  using Series = RecordedSeries;
  return StoredRow<Series>()
      .add("label", &Series::label)
      .add("signed", &Series::is_signed)
      .add("relative_tolerance", &Series::relative_tolerance)
      .add("max_iterations", &Series::max_iterations)
      .add("change", &Series::change)
      .add("problems", &Series::problems);
}

Result<RecordedHead> read_head(const std::filesystem::path& file) {
  auto reader = SIDESTEP_TRY(ResultsReader::open(file));
  return read_recorded_head(*reader, file.string());
}

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

Result<RecordedStart> start_recorded(const ExperimentContext& context, const ProblemChoice& choice,
                                     const std::vector<std::string>& changes) {
  const Node& experiment = block_of(context.configuration, "experiment");
  if (choice.problems.empty()) {
    return tl::make_unexpected(
        experiment.error("there is no file of recorded problems",
                         "say where they are: --set experiment.problems=FILE"));
  }
  std::vector<Error> errors;
  auto problems = read_chosen_problems(experiment, choice, errors);
  if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
  RecordedHead head{divided_run_of(context), problems.file.filename().string(),
                    problems.robot->description().name,
                    block_of(context.configuration, "optimiser").find("plugin")->text(),
                    choice.repeats};
  // Each machine may have the file in another place.
  const std::string content = SIDESTEP_TRY(read_file(choice.problems));
  head.identity = identity_of(context, {"threads", "problems"}) +
                  format("contents of the problems: %016llx\n",
                         static_cast<unsigned long long>(derive_seed(0, content)));
  std::int64_t most = 0;
  context.log.debug("read " + choice.problems.string() + ": " +
                    std::to_string(problems.scenes.size()) + " scenes, " +
                    std::to_string(problems.pairs.size()) + " pairs of " +
                    std::to_string(problems.configurations.size()) + " configurations; " +
                    std::to_string(problems.runs.size()) + " runs are taken");
  for (const RecordedRun& run : problems.runs) {
    most = std::max(most, std::ssize(run.outcomes));
    for (const std::string& change : changes) {
      head.series.push_back({run.label, run.is_signed, run.relative_tolerance, run.max_iterations,
                             change, std::ssize(run.outcomes)});
    }
  }
  if (context.shard.count > most) {
    return fail(ErrorCode::kConfig,
                "there are " + std::to_string(most) + " problems, too few for " +
                    std::to_string(context.shard.count) + " shards",
                choice.problems.string());
  }
  return RecordedStart{std::move(problems), std::move(head)};
}

void record_recorded_head(const RecordedHead& head, Recorder& recorder) {
  record_run_head(head, kHead, recorder);
  stored_head().record(head, kHead, 0, recorder);
  stored_series().record_all(head.series, "series", recorder);
}

Result<RecordedHead> read_recorded_head(ResultsReader& reader, const std::string& file) {
  auto head = SIDESTEP_TRY(stored_head().read(reader, kHead, 0, file));
  static_cast<DividedRun&>(head) = SIDESTEP_TRY(read_run_head(reader, kHead, file));
  std::int64_t item = 0;
  for (RecordedSeries& series : head.series) {
    series = SIDESTEP_TRY(stored_series().read(reader, "series", item++, file));
  }
  return head;
}

Result<void> merge_recorded(const std::vector<std::filesystem::path>& shards,
                            const std::filesystem::path& out) {
  const auto whole = SIDESTEP_TRY(merged_record(
      shards, &read_head, +[](RecordedHead&, RecordedHead) {}));
  return absorb_shards(whole, shards, out, kHead,
                       [&](Recorder& recorder) { record_recorded_head(whole, recorder); });
}

TimedSolve solve_timed(PluginPtr<Optimiser>& optimiser, const Problem& problem,
                       const Trajectory& initial, const ExperimentContext& context) {
  const Stopwatch watch;
  auto solution = call_plugin(plugin_of(optimiser), [&] {
    return optimiser->solve(problem, initial, Deadline(context.stop));
  });
  return {std::move(solution), watch.elapsed_ms()};
}

void note(const TimedSolve& timed, RecordedSolve& record) {
  const bool is_first = record.repeats++ == 0;
  record.solve_ms = is_first ? timed.elapsed_ms : std::min(record.solve_ms, timed.elapsed_ms);
  if (!is_first) return;
  if (!timed.solution) {
    record.reason = timed.solution.error().describe();
    return;
  }
  const Solution& solution = *timed.solution;
  record.solved = solution.trajectory.size() > 0;
  record.status = to_string(solution.status);
  record.reason = solution.reason;
  record.iterations = solution.iterations;
  record.accepted_iterations = solution.accepted_iterations;
  record.initial_cost = solution.initial_cost;
  record.cost = solution.cost;
}

bool are_ends_free(const RecordedProblems& problems, int scene, const Problem& problem) {
  return std::ranges::all_of(std::array{&problem.start.q, &problem.goal.q}, [&](const auto* q) {
    return exact_clearance_m(problems, scene, as_span(*q)) > 0.0;
  });
}

std::string SolveCount::failure(const std::string& what, const char* came_to) const {
  const std::string count = std::to_string(problems) + " " + what;
  if (fault) return "Ended early, after " + count + ": " + fault->describe();
  if (interrupted) {
    return "Interrupted after " + count + "; what was measured is saved, --resume goes on.";
  }
  if (!complete()) {
    return "Incomplete: " + std::to_string(finished) + " of " + std::to_string(planned) + " " +
           what + ".";
  }
  if (unsolved == 0) return "";
  return "Failed: " + std::to_string(unsolved) + " of " + count + " " + came_to +
         ", the first because: " + first_reason + ".";
}

ExperimentOutcome summarise_solves(const RecordedHead& head, const std::string& experiment,
                                   const SolveCount& count, const std::string& verdict,
                                   const report::ResultColumns& columns,
                                   const nlohmann::ordered_json& particulars) {
  using Json = nlohmann::ordered_json;
  const Json& rows = particulars.back();
  ExperimentOutcome outcome;
  outcome.interrupted = count.interrupted;
  outcome.fault = count.fault;
  outcome.success = count.success();
  outcome.verdict =
      (head.shard.is_whole() ? "" : "Shard " + shard_name(head.shard) + ": ") + verdict;
  outcome.table = columns.text(rows);
  outcome.table_csv = columns.csv(rows);
  Json all = {{"fault", count.fault ? Json(count.fault->describe()) : Json(nullptr)},
              {"complete", count.complete()},
              {"shard", shard_json(head.shard)},
              {"problems_file", head.problems_file},
              {"robot", head.robot},
              {"optimiser", head.optimiser},
              {"repeats", head.repeats}};
  all.update(Json::parse(head.about, nullptr, false));
  all.update(particulars);
  all["time"] = time_json(head);
  outcome.summary_json = summary_text(head.provenance, experiment, outcome, all);
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
