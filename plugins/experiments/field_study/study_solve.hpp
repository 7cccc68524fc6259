#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include <sidestep/core/time.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/host.hpp>

#include "study_settings.hpp"

namespace sidestep {

/// The two kinds of field that a study compares, as indices.
inline constexpr std::size_t kUnsigned = 0;
inline constexpr std::size_t kSigned = 1;
inline constexpr std::array<const char*, 2> kFieldNames = {"unsigned", "signed"};

/// What one field led to on one problem.
struct FieldOutcome {
  bool attempted = false;  ///< False where the problem was skipped: nothing else is meaningful.
  SolveStatus status = SolveStatus::kFailed;
  bool collision_free = false;  ///< In the true scene, over continuous time.
  int iterations = 0;           ///< That changed the trajectory, as GPMP2 counts them.
  int steps = 0;                ///< Tried, accepted or not.
  double cost = 0.0;
  double clearance_m = 0.0;  ///< Least, to the true scene; infinity without obstacles.
  double solve_ms = 0.0;
  double check_ms = 0.0;
};

/// One row of the study: a pair of states in a scene.
struct ProblemOutcome {
  std::int64_t problem = 0;  ///< scene * pairs + pair.
  bool start_free = false;
  bool goal_free = false;
  std::array<FieldOutcome, 2> fields;

  [[nodiscard]] bool is_attempted() const noexcept {
    return fields[0].attempted && fields[1].attempted;
  }
  [[nodiscard]] bool is_solvable() const noexcept {
    return fields[0].collision_free || fields[1].collision_free;
  }
  [[nodiscard]] bool is_solved_by_both() const noexcept {
    return fields[0].collision_free && fields[1].collision_free;
  }
};

/// What all problems of one scene share. Immutable; any thread.
struct StudyScene {
  int scene = 0;
  std::array<std::shared_ptr<const DistanceField>, 2> fields;
  std::shared_ptr<const ValidityCheck> check;  ///< Against the true scene, obstacles alone.
  std::vector<char> state_free;                ///< By state.
};

/// The states of a pair: 0 is (0, 1), then (0, 2), ....
[[nodiscard]] std::pair<int, int> states_of_pair(std::int64_t pair, int states);

/// Solves problems of one robot, one after the other; one object a thread. The optimiser is the
/// configuration's, from a straight line; what is collision-free is for scene.check to say.
class StudySolver {
 public:
  StudySolver(const StudyRobot& study, std::shared_ptr<const RobotModel> robot,
              std::span<const Eigen::VectorXd> states, PluginPtr<Optimiser> optimiser,
              bool skips_collisions);

  /// Fails with kCancelled where the deadline passes, and with what the optimiser fails with.
  [[nodiscard]] Result<ProblemOutcome> solve(const StudyScene& scene, std::int64_t pair,
                                             const Deadline& deadline);

 private:
  [[nodiscard]] Result<FieldOutcome> solve_in(const StudyScene& scene, std::size_t kind, int start,
                                              int goal, const Deadline& deadline);

  const StudyRobot& study_;
  std::shared_ptr<const RobotModel> robot_;
  std::span<const Eigen::VectorXd> states_;
  PluginPtr<Optimiser> optimiser_;
  bool skips_collisions_;
};

}  // namespace sidestep
