#include "study_comparison.hpp"

#include <functional>
#include <limits>
#include <optional>

#include <sidestep/core/seed.hpp>

namespace sidestep {
namespace {

bool free_in(const ProblemOutcome& problem, std::size_t kind) {
  return problem.fields[kind].collision_free;
}

/// A number of a problem; nothing where the problem has none.
using NumberOf = std::function<std::optional<double>(const ProblemOutcome&)>;

class Summariser {
 public:
  Summariser(const StudyRobotRows& robot, const ComparisonOptions& options)
      : robot_(robot), options_(options) {}

  [[nodiscard]] MeanWithInterval mean(const char* name, const NumberOf& quantity) const {
    std::vector<double> values, sums, counts;
    std::int64_t scene = -1;
    for (const ProblemOutcome& problem : robot_.problems) {
      if (robot_.scene_of(problem) != scene) {
        scene = robot_.scene_of(problem);
        sums.push_back(0.0);
        counts.push_back(0.0);
      }
      const std::optional<double> value = quantity(problem);
      if (!value) continue;
      values.push_back(*value);
      sums.back() += *value;
      counts.back() += 1.0;
    }
    MeanWithInterval result;
    result.count = static_cast<std::int64_t>(values.size());
    result.statistics = statistics_of(values);
    const std::uint64_t seed = derive_seed(options_.seed, "bootstrap/" + robot_.name + "/" + name);
    result.interval =
        bootstrap_ratio(sums, counts, options_.bootstrap_samples, options_.confidence, seed);
    return result;
  }

 private:
  const StudyRobotRows& robot_;
  const ComparisonOptions& options_;
};

void count_outcomes(const StudyRobotRows& robot, RobotComparison& result) {
  for (const ProblemOutcome& problem : robot.problems) {
    ++result.problems;
    if (!problem.start_free || !problem.goal_free) ++result.in_collision;
    if (!problem.is_attempted()) {
      ++result.skipped;
      continue;
    }
    const bool plain = free_in(problem, kUnsigned), sign = free_in(problem, kSigned);
    ++(plain && sign ? result.both
       : plain       ? result.only_unsigned
       : sign        ? result.only_signed
                     : result.neither);
    for (const std::size_t kind : {kUnsigned, kSigned}) {
      FieldComparison& field = result.fields[kind];
      ++field.attempted;
      if (free_in(problem, kind)) ++field.collision_free;
      ++field.ended[static_cast<std::size_t>(problem.fields[kind].status)];
      field.solve_s += 1e-3 * problem.fields[kind].solve_ms;
      field.check_s += 1e-3 * problem.fields[kind].check_ms;
    }
  }
}

void compare_field(const StudyRobotRows& robot, const ComparisonOptions& options,
                   const Summariser& summarise, std::size_t kind, RobotComparison& result) {
  FieldComparison& field = result.fields[kind];
  field.failures = kind == kUnsigned ? result.only_signed : result.only_unsigned;
  field.failure_share = result.solvable() > 0 ? static_cast<double>(field.failures) /
                                                    static_cast<double>(result.solvable())
                                              : std::numeric_limits<double>::quiet_NaN();
  field.failure_interval = wilson_interval(field.failures, result.solvable(), options.confidence);
  const auto of = [kind](auto member, auto applies) -> NumberOf {
    return [kind, member, applies](const ProblemOutcome& problem) -> std::optional<double> {
      if (!std::invoke(applies, problem)) return std::nullopt;
      return static_cast<double>(problem.fields[kind].*member);
    };
  };
  field.iterations =
      summarise.mean("iterations", of(&FieldOutcome::iterations, &ProblemOutcome::is_attempted));
  field.iterations_solvable = summarise.mean(
      "iterations_solvable", of(&FieldOutcome::iterations, &ProblemOutcome::is_solvable));
  field.steps = summarise.mean("steps", of(&FieldOutcome::steps, &ProblemOutcome::is_attempted));
  field.valid_cost =
      summarise.mean("valid_cost", of(&FieldOutcome::cost, &ProblemOutcome::is_solved_by_both));
  std::vector<double> solve_ms, check_ms;
  for (const ProblemOutcome& problem : robot.problems) {
    if (!problem.is_attempted()) continue;
    solve_ms.push_back(problem.fields[kind].solve_ms);
    check_ms.push_back(problem.fields[kind].check_ms);
  }
  field.solve_ms = statistics_of(solve_ms);
  field.check_ms = statistics_of(check_ms);
}

/// Signed minus unsigned where `applies`.
NumberOf difference_of(auto member, auto applies) {
  return [member, applies](const ProblemOutcome& problem) -> std::optional<double> {
    if (!std::invoke(applies, problem)) return std::nullopt;
    return static_cast<double>(problem.fields[kSigned].*member) -
           static_cast<double>(problem.fields[kUnsigned].*member);
  };
}

}  // namespace

RobotComparison compare_fields(const StudyRobotRows& robot, const ComparisonOptions& options) {
  RobotComparison result;
  const Summariser summarise(robot, options);
  count_outcomes(robot, result);
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    compare_field(robot, options, summarise, kind, result);
  }
  const MeanWithInterval failure =
      summarise.mean("failure_difference", [](const ProblemOutcome& problem) {
        if (!problem.is_solvable()) return std::optional<double>();
        return std::optional<double>((free_in(problem, kSigned) ? 0.0 : 1.0) -
                                     (free_in(problem, kUnsigned) ? 0.0 : 1.0));
      });
  result.failure_difference =
      failure.count > 0 ? failure.statistics.mean : std::numeric_limits<double>::quiet_NaN();
  result.failure_difference_interval = failure.interval;
  result.iterations_difference =
      summarise.mean("iterations_difference",
                     difference_of(&FieldOutcome::iterations, &ProblemOutcome::is_attempted));
  result.cost_difference = summarise.mean(
      "cost_difference", difference_of(&FieldOutcome::cost, &ProblemOutcome::is_solved_by_both));
  return result;
}

}  // namespace sidestep
