#include "gp_chain_cuda.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "describe.hpp"

namespace sidestep::gp_chain_cuda {

static_assert(FieldBlock::kVoxels == PlaceBlocks::kVoxels);
static_assert(sizeof(KnownBlock) == PlaceBlocks::kRows * sizeof(std::uint16_t));

Result<void> FieldMirror::show(ChainBatch& batch, const FieldOnDevice& shape,
                               const DenseField& field) {
  const DenseField::Blocks& blocks = field.blocks();
  const DenseField::KnownBlocks& known = field.known_blocks();
  const bool is_new = blocks_.size() != blocks.size();
  changed_.clear();
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    if (!is_new && &blocks.block(b) == &blocks_.block(b) && &known.block(b) == &known_.block(b)) {
      continue;
    }
    changed_.push_back({static_cast<std::int32_t>(b), blocks.block(b).distance_m.data(),
                        known.block(b).rows.data()});
  }
  SIDESTEP_TRY(batch.set_field(shape, changed_));
  blocks_ = blocks;
  known_ = known;
  return {};
}

namespace {

/// The support states of a trajectory, with the problem's start and goal where these are held.
std::vector<double> support_of(const Problem& problem, const ChainProblem& sizes,
                               const Trajectory& trajectory) {
  std::vector<double> support;
  for (int i = 0; i < trajectory.size(); ++i) {
    support.insert(support.end(), trajectory.q(i).begin(), trajectory.q(i).end());
    support.insert(support.end(), trajectory.qdot(i).begin(), trajectory.qdot(i).end());
  }
  const auto put = [](const RobotState& state, auto to) {
    to = std::ranges::copy(state.q, to).out;
    std::ranges::copy(state.qdot, to);
  };
  if (sizes.is_start_held) put(problem.start, support.begin());
  if (sizes.is_goal_held) put(problem.goal, support.end() - sizes.width());
  return support;
}

Trajectory trajectory_of(const ChainProblem& sizes, const double* support) {
  Trajectory out = make_trajectory(sizes.dof, sizes.states, sizes.dt_s);
  for (int i = 0; i < out.size(); ++i, support += sizes.width()) {
    std::copy_n(support, sizes.dof, out.q(i).begin());
    std::copy_n(support + sizes.dof, sizes.dof, out.qdot(i).begin());
  }
  return out;
}

/// How a chain's minimisation ended; one that has not was cut short.
Minimisation end_of(const ChainState& state) {
  using End = Minimisation::End;
  End end = End::kDeadline;
  if (state.standing == Standing::kConverged) end = End::kConverged;
  if (state.standing == Standing::kIterationLimit) end = End::kIterationLimit;
  if (state.standing == Standing::kSingular) end = End::kSingular;
  return {end, state.accepted, state.tried, state.last_decrease};
}

/// The normal numbers of samples 1, 2, ..., drawn once: sample i has those of seed + i, of which
/// shorter chains use the first.
class NormalNumbers {
 public:
  explicit NormalNumbers(std::uint64_t seed) : seed_(seed) {}

  /// Makes sure of `each` numbers of each of `samples` samples.
  void reserve(std::size_t samples, std::size_t each) {
    if (samples <= samples_ && each <= each_) return;
    samples_ = std::max(samples, samples_);
    each_ = std::max(each, each_);
    ++version_;
    values_.resize(samples_ * each_);
    for (std::size_t i = 0; i < samples_; ++i) {
      std::mt19937_64 generator(seed_ + i + 1);
      std::normal_distribution<double> normal;
      std::generate_n(values_.begin() + static_cast<std::ptrdiff_t>(i * each_), each_,
                      [&] { return normal(generator); });
    }
  }

  [[nodiscard]] const std::vector<double>& values() const noexcept { return values_; }
  [[nodiscard]] std::size_t each() const noexcept { return each_; }
  /// Another one whenever the numbers are.
  [[nodiscard]] std::uint64_t version() const noexcept { return version_; }

 private:
  std::uint64_t seed_;
  std::size_t samples_ = 0, each_ = 0;
  std::uint64_t version_ = 0;
  std::vector<double> values_;
};

class GpChainCuda final : public Optimiser {
 public:
  GpChainCuda(const Options& settings, WorkerPool* workers, Log& log, std::uint64_t seed)
      : settings_(settings), workers_(workers), log_(log), seed_(seed), normals_(seed) {}

  Result<void> open(const MakeBatch& make) {
    auto batch = make();
    if (!batch) return fall_back(std::move(batch.error()));
    batch_ = std::move(*batch);
    return {};
  }

  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                       const Deadline& deadline) override {
    SIDESTEP_TRY(problem.validate());
    SIDESTEP_TRY(check_initial(problem, initial));
    if (batch_ == nullptr) return on_cpu().solve(problem, initial, deadline);
    const Stopwatch watch;
    const auto described = describe(problem);
    if (!described) {
      if (settings_.fallback != "cpu") return error_of(described);
      say_once(described.error());
      return on_cpu().solve(problem, initial, deadline);
    }
    auto solution = on_device(problem, *described, initial, deadline);
    if (!solution) {
      SIDESTEP_TRY(fall_back(std::move(solution.error())));
      return on_cpu().solve(problem, initial, deadline);
    }
    solution->solve_ms = watch.elapsed_ms();
    return solution;
  }

 private:
  /// Fails where the device does.
  Result<Solution> on_device(const Problem& problem, const DescribedProblem& described,
                             const Trajectory& initial, const Deadline& deadline) {
    const ChainProblem& sizes = described.chain.problem;
    if (described.field) {
      SIDESTEP_TRY(mirror_.show(*batch_, described.field_shape, *described.field));
    }
    SIDESTEP_TRY(begin(problem, described, initial));
    auto moving = batch_->move(0);
    while (moving && *moving > 0 && !deadline.expired()) moving = batch_->move(1);
    if (!moving) return error_of(moving);
    const auto outcome = SIDESTEP_TRY(batch_->outcome());

    const auto found = [&](int chain) {
      return trajectory_of(sizes, &outcome.trajectories[static_cast<std::size_t>(chain) *
                                                        static_cast<std::size_t>(sizes.values())]);
    };
    const int chosen = choose(problem, outcome.states, found, deadline);
    Solution solution;
    solution.initial_cost = outcome.states.front().initial_cost;
    const ChainState state = outcome.states[static_cast<std::size_t>(chosen)];
    conclude(end_of(state), rules().stop, state.cost, deadline, solution);
    solution.cost = state.cost;
    solution.trajectory = found(chosen);
    const auto terms = SIDESTEP_TRY(batch_->term_costs(chosen));
    solution.terms = name_terms(problem, terms);
    if (state.standing == Standing::kNotFinite) name_broken_term(solution);
    if (solution.status == SolveStatus::kFailed) solution.trajectory = {};
    return solution;
  }

  [[nodiscard]] MinimisationRules rules() const {
    return {{settings_.relative_tolerance, settings_.absolute_tolerance, settings_.max_iterations},
            settings_.initial_damping};
  }

  Result<void> begin(const Problem& problem, const DescribedProblem& described,
                     const Trajectory& initial) {
    const ChainProblem& sizes = described.chain.problem;
    const std::vector<double> support = support_of(problem, sizes, initial);
    std::vector<ChainStart> starts;
    for (int i = 0; i < settings_.starts; ++i) {
      starts.push_back({support, described.own_numbers, i});
    }
    SamplesOnHost samples = describe_samples(problem, settings_.spread);
    normals_.reserve(starts.size() - 1, support.size());
    samples.version = normals_.version();
    samples.normals = normals_.values();
    samples.stride = static_cast<std::int64_t>(normals_.each());
    return batch_->begin(described.chain, rules(), starts, samples);
  }

  /// Of several chains the one that settings.accept names; the cheapest where none is valid.
  template <class Found>
  int choose(const Problem& problem, std::span<const ChainState> states, const Found& found,
             const Deadline& deadline) {
    if (states.size() == 1) return 0;
    const auto of = [&](int chain) { return states[static_cast<std::size_t>(chain)]; };
    std::vector<int> by_cost(states.size());
    std::iota(by_cost.begin(), by_cost.end(), 0);
    std::ranges::stable_sort(by_cost, [&](int a, int b) {
      const bool a_finite = std::isfinite(of(a).cost), b_finite = std::isfinite(of(b).cost);
      if (a_finite != b_finite) return a_finite;
      return a_finite && of(a).cost < of(b).cost;
    });
    std::vector<int> in_turn = by_cost;
    if (settings_.accept == "first_valid") std::ranges::sort(in_turn);
    if (!checks_ || checks_->robot() != problem.robot.get()) checks_.emplace(problem.robot);
    const Judge judge(problem, *checks_);
    const auto chosen = std::ranges::find_if(in_turn, [&](int chain) {
      return std::isfinite(of(chain).cost) && judge.accepts(found(chain), deadline);
    });
    return chosen != in_turn.end() ? *chosen : by_cost.front();
  }

  /// Goes on with gp_chain from here, where that is wanted.
  Result<void> fall_back(Error why) {
    if (settings_.fallback != "cpu") {
      if (why.hint.empty()) why.hint = "fallback: cpu goes on with the optimiser gp_chain";
      return tl::make_unexpected(std::move(why));
    }
    batch_.reset();
    log_.warn("optimiser gp_chain_cuda goes on as gp_chain, on the CPU: " + why.describe());
    return {};
  }
  void say_once(const Error& why) {
    if (std::exchange(has_said_, true)) return;
    log_.warn("optimiser gp_chain_cuda solves such problems with gp_chain, on the CPU: " +
              why.describe());
  }
  Optimiser& on_cpu() {
    // As many starts as a GPU takes at once would take the CPU too long.
    constexpr int kMostOnCpu = 8;
    if (cpu_ == nullptr) {
      GpChainSettings settings = settings_;
      settings.starts = std::min(settings.starts, kMostOnCpu);
      cpu_ = make_gp_chain(settings, workers_, seed_);
    }
    return *cpu_;
  }

  Options settings_;
  WorkerPool* workers_;
  Log& log_;
  std::uint64_t seed_;
  std::unique_ptr<ChainBatch> batch_;  ///< Null once the device has failed.
  FieldMirror mirror_;
  NormalNumbers normals_;
  std::optional<FieldChecks> checks_;  ///< Of the last problem's robot; for several starts.
  std::unique_ptr<Optimiser> cpu_;
  bool has_said_ = false;
};

}  // namespace

Result<std::unique_ptr<Optimiser>> make_gp_chain_cuda(const Options& settings, WorkerPool* workers,
                                                      Log& log, std::uint64_t seed,
                                                      const MakeBatch& make) {
  auto made = std::make_unique<GpChainCuda>(settings, workers, log, seed);
  SIDESTEP_TRY(made->open(make));
  return made;
}

}  // namespace sidestep::gp_chain_cuda
