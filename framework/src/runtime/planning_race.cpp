#include <sidestep/runtime/planning_race.hpp>

#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include <sidestep/planning/explain.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/runtime/call_plugin.hpp>
#include <sidestep/runtime/motion_planning.hpp>
#include <sidestep/trajectory/blend.hpp>

namespace sidestep {
namespace {

constexpr int kStages = 150;  ///< Of a motion's timing: mostly within 1 % of the fastest.
constexpr int kMostGuesses = 1000;
/// A path that cannot be polished is so again with so many times as many states, each time.
constexpr int kFiner = 2;
constexpr int kMostPolishes = 3;
/// How far from a corner its rounding begins, in m and rad: as far as mostly is clear, then closer.
constexpr double kRounding[] = {0.5, 0.1};

/// The same motion on more states.
Problem finer(const Problem& problem) {
  Problem fine = problem;
  fine.support_states = kFiner * (problem.support_states - 1) + 1;
  fine.dt_s = problem.dt_s / kFiner;
  return fine;
}

/// What the problem makes of a timed motion, at its own support states; nothing where it cannot
/// tell.
std::optional<double> cost_of(const Problem& problem, const Trajectory& timed) {
  const auto explained = explain(problem, refit(timed, 0.0, problem.support_states, problem.dt_s));
  if (!explained) return std::nullopt;
  return explained->cost;
}

}  // namespace

/// What a proposal is; the later, the better.
enum class PlanningRace::Kind { kNone, kSampled, kRounded, kOptimised };

/// What lanes share.
struct PlanningRace::Track {
  const Problem& problem;
  const Checks& checks;
  const Deadline& deadline;
  std::stop_source over;
  Stopwatch watch;
  std::mutex mutex;  ///< Of what follows.
  RaceResult result;
  Kind kind = Kind::kNone;  ///< Of the result.
  std::optional<Error> error;

  /// Whether a motion that passed the check is to take the place of the result.
  [[nodiscard]] bool is_better(Kind other, const Trajectory& timed) const {
    if (other <= kind || kind != Kind::kRounded) return other > kind;
    const auto cost = cost_of(problem, timed), to_beat = cost_of(problem, result.trajectory);
    return cost && (!to_beat || *cost < *to_beat);
  }
  [[nodiscard]] bool is_over() const { return over.stop_requested() || deadline.expired(); }
  [[nodiscard]] Deadline until_over() const {
    return Deadline::after_s(deadline.remaining_s(), over.get_token());
  }
  /// What was cut off by the deadline tells nothing that an earlier reason does not.
  void note(std::string reason) {
    const std::scoped_lock lock(mutex);
    if (result.trajectory.size() > 0 || (deadline.expired() && !result.reason.empty())) return;
    result.reason = std::move(reason);
  }
};

Result<RaceResult> PlanningRace::run(const Problem& problem, const Checks& checks,
                                     std::uint64_t seed, const Deadline& deadline,
                                     const std::stop_token& stop) {
  Track track{.problem = problem, .checks = checks, .deadline = deadline};
  const std::stop_callback forward(stop, [&] { track.over.request_stop(); });
  const auto drive = [&](Lane& lane) {
    const auto done = catch_all("planning", [&]() -> Result<void> {
      lane.seed == "sampled" ? run_sampled(lane, track) : run_straight(lane, track, seed);
      return {};
    });
    if (done) return;
    const std::scoped_lock lock(track.mutex);
    track.error = done.error();
    track.over.request_stop();
  };
  if (!lanes_.empty()) {
    // The last lane begins at once; a thread takes a while to start, and its memory is cold.
    std::vector<std::jthread> others;
    for (std::size_t i = 0; i + 1 < lanes_.size(); ++i) {
      others.emplace_back([&, i] { drive(lanes_[i]); });
    }
    drive(lanes_.back());
  }
  if (track.error) return tl::make_unexpected(std::move(*track.error));
  track.result.spent_ms = track.watch.elapsed_ms();
  return std::move(track.result);
}

std::optional<Trajectory> PlanningRace::propose(PluginPtr<Optimiser>& optimiser,
                                                const Problem& problem, const Trajectory& guess,
                                                Track& track) const {
  auto proposal =
      propose_motion(*optimiser, plugin_of(optimiser), problem, guess, track.until_over());
  if (!proposal) {
    const std::scoped_lock lock(track.mutex);
    track.error = proposal.error();
    track.over.request_stop();
    return std::nullopt;
  }
  if (!proposal->failure.empty()) {
    track.note(plugin_of(optimiser) + " " + proposal->failure);
    return std::nullopt;
  }
  return std::move(proposal->solution.trajectory);
}

/// Times and checks a proposal; whether it is valid. An optimiser's then ends the race.
bool PlanningRace::finish(const Trajectory& proposal, Kind kind, const std::string& seed,
                          Track& track) const {
  const ValidityCheck& check = kind == Kind::kSampled ? track.checks.sampled : track.checks.smooth;
  auto motion = retime_and_check(
      track.problem, proposal, {&limits_, &check, {.least_stages = kStages, .stop_at_goal = true}},
      track.until_over());
  if (!motion || !motion->failure.empty()) {
    track.note(motion ? motion->failure : motion.error().describe());
    return false;
  }
  const std::scoped_lock lock(track.mutex);
  if (kind == Kind::kOptimised) track.over.request_stop();
  if (!track.is_better(kind, motion->trajectory)) return true;
  RaceResult& result = track.result;
  if (track.kind != Kind::kNone) {
    result.earlier.push_back({std::move(result.trajectory), result.is_smooth, result.took_ms});
  }
  result = {std::move(motion->trajectory), seed, kind != Kind::kSampled,
            track.watch.elapsed_ms(),      {},   std::move(result.earlier)};
  track.kind = kind;
  return true;
}

void PlanningRace::run_straight(Lane& lane, Track& track, std::uint64_t seed) {
  const Problem& problem = track.problem;
  for (int guess = 0; guess < kMostGuesses && !track.is_over(); ++guess) {
    const auto proposal =
        propose(lane.optimiser, problem, initial_guess(problem, guess, seed), track);
    if (proposal && finish(*proposal, Kind::kOptimised, lane.seed, track)) return;
    if (lanes_.size() == 1 && guess == 0) return;  // that guess alone was asked for
  }
}

void PlanningRace::run_sampled(Lane& lane, Track& track) {
  const Problem& problem = track.problem;
  const auto path = propose(lane.sampler, problem, initial_guess(problem, 0, 0), track);
  if (!path) return;
  // One that stops at its corners is better than none.
  const bool is_valid = finish(*path, Kind::kSampled, lane.seed, track);
  if (lane.optimiser) {
    if (is_valid) round_corners(*path, lane.seed, track);
    polish(lane, *path, track);
  } else if (is_valid) {
    track.over.request_stop();
  }
}

void PlanningRace::round_corners(const Trajectory& path, const std::string& seed,
                                 Track& track) const {
  for (const double reach : kRounding) {
    if (track.is_over()) return;
    const auto rounded = blend_corners(path, reach);
    if (!rounded) return track.note("no corners to round off: " + rounded.error().describe());
    if (finish(*rounded, Kind::kRounded, seed, track)) return;
  }
}

/// Lets the optimiser start from a sampled path; ends the race if that has a smooth answer at last.
void PlanningRace::polish(Lane& lane, const Trajectory& path, Track& track) const {
  Problem problem = track.problem;
  for (int polish = 0; polish < kMostPolishes && !track.is_over(); ++polish) {
    if (polish > 0) problem = finer(problem);
    const Trajectory guess = refit(path, 0.0, problem.support_states, problem.dt_s);
    const auto polished = propose(lane.optimiser, problem, guess, track);
    if (polished && finish(*polished, Kind::kOptimised, lane.seed, track)) return;
  }
  const std::scoped_lock lock(track.mutex);
  if (track.result.is_smooth) track.over.request_stop();
}

}  // namespace sidestep
