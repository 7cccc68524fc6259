// The simulated robot, with the faults of drives and of the connection to them.
#include <limits>

#include "fault_window.hpp"
#include "simulated_executor.hpp"

namespace sidestep::faulty {
namespace {

/// `start` is where the experiment looks for it.
struct Options : FaultOptions {
  Node start;
  simulated::Options as;
  static Parameters<Options> parameters() {
    return declare_fault<Options>({"refuses", "throws_on_follow", "throws_on_current",
                                   "throws_at_all", "silent", "fails", "measures_nan",
                                   "stands_still", "hangs", "truth_throws"})
        .add("as", &Options::as, "Parameters of what is wrapped.")
        .add("start", &Options::start, "Where the robot stands at first.");
  }
};

class FaultyExecutor final : public Executor, public TrueRobot {
 public:
  FaultyExecutor(const Options& options, std::unique_ptr<Executor> robot, const Clock& clock)
      : window_(options, clock),
        robot_(std::move(robot)),
        truth_(dynamic_cast<TrueRobot&>(*robot_)) {}

  Result<Measured> current() override {
    window_.pass("throws_on_current");
    window_.pass("throws_at_all");
    if (window_.has("fails")) return fail(ErrorCode::kIo, "no word from the robot");
    if (window_.has("hangs")) window_.hang();
    if (window_.has("stands_still")) stand_still();
    auto measured = robot_->current();
    if (!measured) return measured;
    if (window_.has("measures_nan")) {
      measured->state.q[1] = std::numeric_limits<double>::quiet_NaN();
    }
    if (!window_.has("silent") || !last_) last_ = *measured;
    return *last_;
  }
  Result<void> follow(const Trajectory& trajectory, Stamp start) override {
    window_.pass("throws_on_follow");
    window_.pass("throws_at_all");
    if (window_.has("refuses")) return fail(ErrorCode::kUnsupported, "the brakes are on");
    if (window_.has("stands_still")) return {};
    return robot_->follow(trajectory, start);
  }
  Result<void> stop() override {
    window_.pass("throws_at_all");
    return robot_->stop();
  }
  RobotState true_state(Stamp stamp) override {
    window_.pass("truth_throws");
    return truth_.true_state(stamp);
  }

 private:
  /// The drives switch themselves off, once.
  void stand_still() {
    if (is_off_) return;
    is_off_ = true;
    (void)robot_->stop();
  }

  FaultWindow window_;
  std::unique_ptr<Executor> robot_;
  TrueRobot& truth_;
  std::optional<Measured> last_;
  bool is_off_ = false;
};

Result<std::unique_ptr<Executor>> create(const Options& options, const HostContext& context) {
  simulated::Options as = options.as;
  as.start = options.start;
  auto robot = simulated::create_executor(as, context);
  if (!robot) return tl::make_unexpected(std::move(robot.error()));
  return std::make_unique<FaultyExecutor>(options, std::move(*robot), context.clock);
}

}  // namespace
}  // namespace sidestep::faulty

SIDESTEP_PLUGIN(sidestep::Executor, sidestep::faulty::Options, sidestep::faulty::create, "faulty",
                "1", "The simulated robot, with faults")
