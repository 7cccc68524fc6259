#include "gp_chain.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/planning/goal.hpp>
#include <sidestep/robot/base_joints.hpp>

#include "minimise.hpp"
#include "prior_chain.hpp"

namespace sidestep {

void conclude(const Minimisation& end, const StoppingRules& stop, double cost,
              const Deadline& deadline, Solution& solution) {
  solution.iterations = end.tried;
  solution.accepted_iterations = end.accepted;
  switch (end.end) {
    case Minimisation::End::kConverged: solution.status = SolveStatus::kConverged; break;
    case Minimisation::End::kIterationLimit:
      solution.status = SolveStatus::kIterationLimit;
      solution.reason = iteration_limit_reason(stop.max_iterations, end.last_decrease, cost);
      break;
    case Minimisation::End::kDeadline:
      solution.status = SolveStatus::kDeadline;
      solution.reason =
          (deadline.stop_requested() ? "stopped on request after " : "the deadline passed after ") +
          std::to_string(end.tried) + " iterations";
      break;
    case Minimisation::End::kSingular:
      solution.status = SolveStatus::kFailed;
      solution.reason =
          "the normal equations are singular: qc, dt_s or the weight of a term is too large or "
          "too small for double precision";
      break;
  }
}

void name_broken_term(Solution& solution) {
  solution.status = SolveStatus::kFailed;
  solution.reason = "the cost of the initial trajectory is not a finite number";
  for (const TermCost& term : solution.terms) {
    if (std::isfinite(term.cost)) continue;
    solution.reason = "the cost of " + term.name + " is not a finite number";
    return;
  }
}

std::vector<TermCost> name_terms(const Problem& problem, std::span<const double> costs) {
  std::vector<TermCost> named{{"gp_prior", costs[0]}};
  for (std::size_t t = 0; t < problem.terms.size(); ++t) {
    named.push_back({std::string(problem.terms[t].cost->name()), costs[t + 1]});
  }
  return named;
}

Judge::Judge(const Problem& problem, const FieldChecks& checks)
    : problem_(problem),
      check_(checks.make(problem.field, problem.space,
                         {.margin_m = problem.collision_margin_m,
                          .speed_fraction = std::numeric_limits<double>::infinity(),
                          .first_violation_only = true})) {}

bool Judge::accepts(const Trajectory& found, const Deadline& deadline) const {
  if (!goal_miss(problem_, found.q(found.size() - 1)).empty()) return false;
  const auto verdict = check_->check(found, 0.0, deadline);
  return verdict.has_value() && verdict->valid();
}

namespace {

/// One of several initial trajectories, and what became of it.
struct Candidate {
  ChainModel model;
  std::unique_ptr<StepRule> rule;
  Minimisation end;
  double initial_cost = 0.0;
  bool is_finite = false;  ///< Its initial cost; else it was not minimised.
  bool is_valid = false;   ///< As far as a Judge has seen it.
};

class GpChain final : public Optimiser {
 public:
  GpChain(const GpChainSettings& settings, WorkerPool* workers, std::uint64_t seed)
      : settings_(settings),
        seed_(seed),
        stop_{settings.relative_tolerance, settings.absolute_tolerance, settings.max_iterations},
        workers_(workers),
        starts_(static_cast<std::size_t>(settings.starts)) {
    for (Candidate& start : starts_) start.rule = make_step_rule(settings);
  }

  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                       const Deadline& deadline) override {
    const Stopwatch watch;
    SIDESTEP_TRY(problem.validate());
    SIDESTEP_TRY(check_initial(problem, initial));
    SIDESTEP_TRY(find_body(problem));
    if (settings_.incremental && starts_.front().model.resume(problem, initial)) {
      minimise_warm_started(starts_.front(), deadline);
    } else {
      minimise_from(starts_.front(), problem, initial, deadline);
    }
    const Candidate* chosen = &starts_.front();
    if (starts_.size() > 1) chosen = &best_of_all(problem, initial, deadline);

    Solution solution;
    solution.initial_cost = starts_.front().initial_cost;
    const ChainEvaluation& found = chosen->model.current();
    if (chosen->is_finite) conclude(chosen->end, stop_, found.cost, deadline, solution);
    solution.terms = name_terms(problem, found.terms);
    solution.cost = found.cost;
    if (!chosen->is_finite) name_broken_term(solution);
    if (solution.status != SolveStatus::kFailed) solution.trajectory = chosen->model.trajectory();
    if (settings_.incremental) starts_.front().model.keep(problem);
    solution.solve_ms = watch.elapsed_ms();
    return solution;
  }

 private:
  /// Fails with kUnsupported where the robot has no planar base, and the prior is to be on its
  /// body.
  [[nodiscard]] Result<void> find_body(const Problem& problem) {
    if (settings_.base_prior != "body" || body_of_ == problem.robot) return {};
    const auto base = SIDESTEP_TRY(BaseJoints::of(*problem.robot));
    body_ = {base.x(), base.y(), base.yaw()};
    body_of_ = problem.robot;
    return {};
  }

  void minimise_from(Candidate& start, const Problem& problem, const Trajectory& initial,
                     const Deadline& deadline) const {
    start.model.reset(problem, initial, body_);
    begin(start);
    if (start.is_finite) start.end = minimise(start.model, *start.rule, stop_, deadline);
  }

  /// Goes on with a model that has resumed.
  void minimise_warm_started(Candidate& start, const Deadline& deadline) {
    begin(start);
    if (start.is_finite) start.end = settle(start.model, *start.rule, stop_, deadline, step_);
  }

  static void begin(Candidate& start) {
    start.initial_cost = start.model.current().cost;
    start.is_finite = std::isfinite(start.initial_cost);
    start.is_valid = false;
    start.end = {};
  }

  /// Goes on from the first start, which is done, to the others.
  const Candidate& best_of_all(const Problem& problem, const Trajectory& initial,
                               const Deadline& deadline) {
    if (!checks_ || checks_->robot() != problem.robot.get()) checks_.emplace(problem.robot);
    const Judge judge(problem, *checks_);
    if (settings_.accept == "first_valid") {
      minimise_others(problem, initial, deadline, &judge);
      const auto first = std::ranges::find_if(starts_, &Candidate::is_valid);
      return first != starts_.end() ? *first : *by_cost().front();
    }
    minimise_others(problem, initial, deadline, nullptr);
    const std::vector<const Candidate*> sorted = by_cost();
    const auto best = std::ranges::find_if(
        sorted, [&](const Candidate* start) { return accepts(judge, *start, deadline); });
    return best != sorted.end() ? **best : *sorted.front();
  }

  /// With a judge, begins no more starts once one that has been minimised is valid. They begin in
  /// order and none is given up, so that the first valid one is always found.
  void minimise_others(const Problem& problem, const Trajectory& initial, const Deadline& deadline,
                       const Judge* judge) {
    std::atomic<bool> enough = false;
    const auto judge_start = [&](Candidate& start) {
      start.is_valid = judge != nullptr && accepts(*judge, start, deadline);
      if (start.is_valid) enough = true;
    };
    judge_start(starts_.front());
    sampler_.reset(problem);
    samples_.resize(starts_.size() * starts_.front().model.current().support.size());
    for (int i = 1; i < settings_.starts; ++i) {
      sampler_.draw(seed_ + static_cast<std::uint64_t>(i), sample(i));
    }
    const auto go = [&](int other) {
      const int i = other + 1;
      Candidate& start = starts_[static_cast<std::size_t>(i)];
      start.is_finite = start.is_valid = false;
      if (enough || deadline.expired()) return;
      minimise_from(start, problem, perturbed(initial, i), deadline);
      judge_start(start);
    };
    const int others = settings_.starts - 1;
    if (workers_ != nullptr) {
      workers_->run(others, go);
    } else {
      for (int i = 0; i < others; ++i) go(i);
    }
  }

  [[nodiscard]] static bool accepts(const Judge& judge, const Candidate& start,
                                    const Deadline& deadline) {
    return start.is_finite && judge.accepts(start.model.trajectory(), deadline);
  }

  /// The starts, the cheapest first.
  [[nodiscard]] std::vector<const Candidate*> by_cost() const {
    std::vector<const Candidate*> sorted;
    for (const Candidate& start : starts_) sorted.push_back(&start);
    std::ranges::stable_sort(sorted, [](const Candidate* a, const Candidate* b) {
      if (a->is_finite != b->is_finite) return a->is_finite;
      return a->is_finite && a->model.current().cost < b->model.current().cost;
    });
    return sorted;
  }

  [[nodiscard]] std::span<double> sample(int start) {
    const std::size_t size = samples_.size() / starts_.size();
    return std::span(samples_).subspan(static_cast<std::size_t>(start) * size, size);
  }

  /// The initial trajectory plus the sample of a start.
  [[nodiscard]] Trajectory perturbed(const Trajectory& initial, int start) {
    Trajectory out = initial;
    const double* by = sample(start).data();
    for (int i = 0; i < out.size(); ++i) {
      for (double& q : out.q(i)) q += settings_.spread * *by++;
      for (double& qdot : out.qdot(i)) qdot += settings_.spread * *by++;
    }
    return out;
  }

  GpChainSettings settings_;
  std::uint64_t seed_;
  StoppingRules stop_;
  WorkerPool* workers_;
  std::vector<Candidate> starts_;
  std::optional<BodyChain::Base> body_;        ///< Nothing: all joints have the prior.
  std::shared_ptr<const RobotModel> body_of_;  ///< Null without a body.
  std::optional<FieldChecks> checks_;          ///< Of the last problem's robot; for several starts.
  std::vector<double> step_;                   ///< Of an incremental solve.
  PriorSampler sampler_;
  std::vector<double> samples_;  ///< Of one start after the other; nothing for the first.
};

}  // namespace

std::vector<OptionMistake> GpChainSettings::check() const {
  if (!incremental || starts == 1) return {};
  return {{{"incremental", "starts"},
           "needs one start, whose trajectory the next solve leads on from; there are " +
               std::to_string(starts),
           "leave out `incremental`, or set `starts` to 1"}};
}

std::unique_ptr<StepRule> make_step_rule(const GpChainSettings& settings) {
  if (settings.method == "gauss_newton") return make_gauss_newton();
  if (settings.method == "dogleg") return make_dogleg(settings.initial_radius);
  return make_levenberg_marquardt(settings.initial_damping, settings.relative_tolerance);
}

std::unique_ptr<Optimiser> make_gp_chain(const GpChainSettings& settings, WorkerPool* workers,
                                         std::uint64_t seed) {
  return std::make_unique<GpChain>(settings, workers, seed);
}

}  // namespace sidestep
