#pragma once

#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/trajectory/motion_limits.hpp>

namespace sidestep {

/// A trajectory that passed the check before a better one did.
struct EarlierAnswer {
  Trajectory trajectory;
  bool is_smooth = false;
  double took_ms = 0.0;
};

/// A planner's answer.
struct RaceResult {
  Trajectory trajectory;   ///< Valid by the check, and timed; empty where there is none.
  std::string seed;        ///< The first guess that led there.
  bool is_smooth = false;  ///< A sampled path stops at its corners, unless they are rounded off.
  double took_ms = 0.0;    ///< From the call until there was a valid trajectory.
  std::string reason;      ///< Why there is none.
  std::vector<EarlierAnswer> earlier;  ///< Those that it took the place of, in order.
  double spent_ms = 0.0;               ///< From the call to its end.
};

/// Plans from several first guesses at once, a thread for each, until an optimiser has made a
/// trajectory of one that passes its check; where none does, a sampled path will do that passes it,
/// best with its corners rounded off. Of a rounded one and an optimiser's, the one is the answer
/// that costs less by the problem's terms.
class PlanningRace {
 public:
  /// One first guess and who makes a trajectory of it. "straight": a straight line, and in a race
  /// with others then lines that are perturbed. "sampled": the path of `sampler`, which is polished
  /// by `optimiser`, or taken as it is where that is null.
  struct Lane {
    std::string seed;
    PluginPtr<Optimiser> optimiser;
    PluginPtr<Optimiser> sampler;
  };

  /// What answers must pass.
  struct Checks {
    const ValidityCheck& sampled;  ///< Paths as their sampler made them, which keeps its distance.
    const ValidityCheck& smooth;   ///< All others.
  };

  PlanningRace(std::vector<Lane> lanes, MotionLimits limits)
      : lanes_(std::move(lanes)), limits_(std::move(limits)) {}

  /// Ends at the deadline, or soon after a stop is asked for. Fails where an optimiser does.
  [[nodiscard]] Result<RaceResult> run(const Problem& problem, const Checks& checks,
                                       std::uint64_t seed, const Deadline& deadline,
                                       const std::stop_token& stop);

 private:
  enum class Kind;
  struct Track;
  void run_straight(Lane& lane, Track& track, std::uint64_t seed);
  void run_sampled(Lane& lane, Track& track);
  [[nodiscard]] std::optional<Trajectory> propose(PluginPtr<Optimiser>& optimiser,
                                                  const Problem& problem, const Trajectory& guess,
                                                  Track& track) const;
  [[nodiscard]] bool finish(const Trajectory& proposal, Kind kind, const std::string& seed,
                            Track& track) const;
  void round_corners(const Trajectory& path, const std::string& seed, Track& track) const;
  void polish(Lane& lane, const Trajectory& path, Track& track) const;

  std::vector<Lane> lanes_;
  MotionLimits limits_;
};

}  // namespace sidestep
