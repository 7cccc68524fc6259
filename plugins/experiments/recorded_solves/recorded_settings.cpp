#include "recorded_settings.hpp"

#include <algorithm>

namespace sidestep {
namespace {

constexpr const char* kRelativeTolerance = "relative_tolerance";
constexpr const char* kMaxIterations = "max_iterations";

void put(Node& block, const char* key, const std::string& value, const SourceMark& mark) {
  block.entries().push_back({key, mark, Node(Node::Scalar{value, false}, mark)});
}

/// Leaves every n-th outcome, and of those as many as are wanted.
void thin_out(std::vector<RecordedOutcome>& outcomes, const ProblemChoice& choice) {
  const auto every = static_cast<std::size_t>(choice.every);
  std::vector<RecordedOutcome> kept;
  for (std::size_t i = 0; i < outcomes.size(); i += every) kept.push_back(outcomes[i]);
  if (choice.limit > 0 && std::ssize(kept) > choice.limit) {
    kept.resize(static_cast<std::size_t>(choice.limit));
  }
  outcomes = std::move(kept);
}

/// A mistake for each label that no run has.
void check_labels(const Node& experiment, const ProblemChoice& choice,
                  const RecordedProblems& problems, std::vector<Error>& errors) {
  std::vector<std::string> labels;
  for (const RecordedRun& run : problems.runs) {
    if (std::ranges::find(labels, run.label) != labels.end()) continue;
    labels.push_back(run.label);
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

std::vector<std::string> set_of_optimiser() { return {kRelativeTolerance, kMaxIterations}; }

Node block_for(const Node& optimiser, const RecordedRun& run) {
  Node block = optimiser;
  const SourceMark mark{"recorded run " + run.label, 0, 0};
  put(block, kRelativeTolerance, detail::number_text(run.relative_tolerance), mark);
  put(block, kMaxIterations, std::to_string(run.max_iterations), mark);
  return block;
}

void check_optimiser(const Node& optimiser, const std::vector<std::string>& names, Host& host,
                     std::vector<Error>& errors) {
  const auto plugin = host.find(PluginKind::kOptimiser, optimiser);
  if (!plugin) return;  // told of where plugins are checked
  for (const std::string& name : names) {
    if (const Node* written = optimiser.find(name)) {
      errors.push_back(written->error(
          "'" + name + "' is set by the experiment, to that of each run", "leave it out"));
    }
    if (std::ranges::find(plugin->schema, name, &Parameter::name) == plugin->schema.end()) {
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

Result<RecordedProblems> read_problems(const Node& experiment, const ProblemChoice& choice) {
  if (choice.problems.empty()) {
    return tl::make_unexpected(
        experiment.error("there is no file of recorded problems",
                         "say where they are: --set experiment.problems=FILE"));
  }
  std::vector<Error> errors;
  auto problems = read_chosen_problems(experiment, choice, errors);
  if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
  return problems;
}

}  // namespace sidestep
