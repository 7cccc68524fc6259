#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <random>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include <sidestep/core/time.hpp>
#include <sidestep/planning/problem.hpp>

namespace sidestep {

/// Configurations that reach a goal which is left to costs (goal.hpp: is_goal_free): within the
/// joints' limits, at rest, where goal_miss() has nothing to say. From each seed Levenberg's and
/// Marquardt's method, damped by the cost itself (Sugihara, IEEE T-RO 2011), lowers what the costs
/// at kGoal measure; joints stop at their limits. Seeds are the problem's goal, its start, then
/// random configurations: all over the limits; of joints without them half a turn, or 2 m, about
/// the goal. Deterministic for equal seeds. One thread at a time.
class InverseKinematics {
 public:
  InverseKinematics(const Problem& problem, std::uint64_t seed);

  /// Descends from the next seed; the configuration that it leads to, joints that turn without
  /// limits within half a turn of the start, if that reaches the goal; else an empty one.
  /// Allocates.
  [[nodiscard]] Eigen::VectorXd next();
  /// The same from a configuration of the caller's (dof values), which counts as no seed.
  [[nodiscard]] Eigen::VectorXd from(const Eigen::VectorXd& seed);
  /// Of what was found so far, the configuration that comes nearest to the goal, whether it reaches
  /// it or not; empty before the first.
  [[nodiscard]] const Eigen::VectorXd& nearest() const noexcept { return nearest_; }
  [[nodiscard]] int seeds() const noexcept { return seeds_; }

 private:
  struct Term {
    std::shared_ptr<const StateCost> cost;
    std::vector<std::vector<Eigen::Index>> groups;  ///< Rows of what goal_miss() judges by length.
  };
  void draw();
  [[nodiscard]] Eigen::VectorXd finish();
  void descend();
  double measure(const Eigen::VectorXd& q, bool with_jacobian);
  [[nodiscard]] double worst_sigmas() const;

  std::shared_ptr<const RobotModel> robot_;
  Eigen::VectorXd start_, goal_, lower_, upper_;
  std::vector<Term> terms_;
  std::mt19937_64 random_;
  int seeds_ = 0;  ///< Drawn so far.
  Eigen::VectorXd q_, candidate_, gradient_, at_rest_, nearest_;
  double nearest_cost_ = 0.0;
  Eigen::VectorXd residuals_;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> jacobian_;
  Eigen::MatrixXd normal_, damped_;
  Eigen::LDLT<Eigen::MatrixXd> factors_;
  Scratch scratch_;
};

/// How many configurations a search for goals wants and how long it goes on.
struct GoalSearch {
  std::size_t wanted = 8;
  int seeds = 64;         ///< After which what was found is enough, if it is one;
  int most_seeds = 2000;  ///< after which there is none.
};

/// The outcome of find_goals().
struct GoalConfigurations {
  std::vector<Eigen::VectorXd> q;  ///< By the time that their way from the start takes.
  Eigen::VectorXd nearest = {};    ///< InverseKinematics::nearest().
  /// Why there are none: "of 2000 searches within the joints' limits none reaches the goal; the
  /// nearest ends with the position of hand 0.14 m off its target", or what `blocked` says of the
  /// last that does.
  std::string reason;
};

/// Configurations that reach the free goal of a problem and are not blocked, no two of them the
/// same within 0.1 m or rad a joint. `blocked`: what is wrong with one, empty if nothing is. [any];
/// allocates.
[[nodiscard]] GoalConfigurations find_goals(
    const Problem& problem, const GoalSearch& how, std::uint64_t seed,
    const std::function<std::string(std::span<const double>)>& blocked, const Deadline& deadline);

}  // namespace sidestep
