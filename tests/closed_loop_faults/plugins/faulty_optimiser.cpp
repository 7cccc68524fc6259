// GPMP2's optimiser, with faults.
#include <algorithm>
#include <limits>

#include "fault_window.hpp"
#include "gp_chain.hpp"

namespace sidestep::faulty {
namespace {

struct Options : FaultOptions {
  static Parameters<Options> parameters() {
    return declare_fault<Options>({"throws", "throws_a_number", "fails", "finds_nothing", "hangs",
                                   "nan", "infinite", "beyond_limits", "too_fast", "joint_count",
                                   "wrong_start", "wrong_end", "times_go_back", "empty"});
  }
};

void move(Trajectory& trajectory, int state, double by_m) { trajectory.q(state)[1] += by_m; }

class FaultyOptimiser final : public Optimiser {
 public:
  FaultyOptimiser(const Options& options, const HostContext& context)
      : window_(options, context.clock),
        fault_(options.fault),
        solver_(make_gp_chain({}, &context.workers, context.seed)) {}

  Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                         const Deadline& deadline) override {
    window_.pass("throws");
    if (window_.has("throws_a_number")) throw 7;
    if (window_.has("fails")) return fail(ErrorCode::kInvalidArgument, "not my kind of problem");
    if (window_.has("hangs")) window_.hang();
    auto solution = solver_->solve(problem, initial, deadline);
    if (solution && window_.is_open()) spoil(*solution);
    return solution;
  }

 private:
  void spoil(Solution& solution) const {
    Trajectory& found = solution.trajectory;
    const int last = found.size() - 1;
    if (last < 2) return;
    if (fault_ == "finds_nothing") {
      solution.status = SolveStatus::kFailed;
      solution.reason = "the numbers went wrong";
      found = {};
    } else if (fault_ == "nan") {
      move(found, last / 2, std::numeric_limits<double>::quiet_NaN());
    } else if (fault_ == "infinite") {
      std::ranges::fill(found.qdot(last / 2), std::numeric_limits<double>::infinity());
    } else if (fault_ == "beyond_limits") {
      move(found, last / 2, 100.0);
    } else if (fault_ == "too_fast") {
      for (double& time_s : found.times_s) time_s *= 0.1;
    } else if (fault_ == "joint_count") {
      found = make_trajectory(3, 5, 0.3);
    } else if (fault_ == "wrong_start") {
      move(found, 0, 0.5);
    } else if (fault_ == "wrong_end") {
      move(found, last, 0.5);
    } else if (fault_ == "times_go_back") {
      std::swap(found.times_s[1], found.times_s[2]);
    } else if (fault_ == "empty") {
      found = {};
    }
  }

  FaultWindow window_;
  std::string fault_;
  std::unique_ptr<Optimiser> solver_;
};

Result<std::unique_ptr<Optimiser>> create(const Options& options, const HostContext& context) {
  return std::make_unique<FaultyOptimiser>(options, context);
}

}  // namespace
}  // namespace sidestep::faulty

SIDESTEP_PLUGIN(sidestep::Optimiser, sidestep::faulty::Options, sidestep::faulty::create, "faulty",
                "1", "GPMP2's optimiser, with faults")
