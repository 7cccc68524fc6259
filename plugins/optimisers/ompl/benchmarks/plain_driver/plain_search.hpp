#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <ompl/geometric/SimpleSetup.h>
#include <Eigen/Core>

#include "sphere_states.hpp"

namespace sidestep::plain_driver {

/// Motions are tested at points at most this far apart, in the Euclidean norm of the joints.
inline constexpr double kStep_rad = 1.0 / 32.0;

/// What was asked of a state check.
struct CheckCount {
  std::int64_t states = 0;
  std::int64_t timed = 0;  ///< Of those: one in so many, so that the clock takes no time.
  double timed_us = 0.0;
};

/// OMPL as its documentation says to use it, and no more: a RealVectorStateSpace within the robot's
/// limits, a state validity checker, RRTConnect with a range of its own, motions tested point by
/// point. Distances are Euclidean in the joints. One thread at a time.
class PlainSearch {
 public:
  /// Every joint must have limits. `margin_m` is that of SphereStates.
  PlainSearch(const std::shared_ptr<const RobotModel>& robot, const Scene& scene, double margin_m);
  PlainSearch(const PlainSearch&) = delete;  // OMPL calls it back
  PlainSearch& operator=(const PlainSearch&) = delete;

  [[nodiscard]] ::ompl::geometric::SimpleSetup& setup() noexcept { return setup_; }
  [[nodiscard]] const CheckCount& count() const noexcept { return count_; }

 private:
  [[nodiscard]] bool is_free(std::span<const double> q);

  SphereStates states_;
  CheckCount count_;
  ::ompl::geometric::SimpleSetup setup_;
};

struct PlainAnswer {
  bool is_solved = false;
  double setup_ms = 0.0;     ///< Before the search: the space, and what OMPL works out about it.
  double search_ms = 0.0;    ///< RRTConnect alone.
  double simplify_ms = 0.0;  ///< SimpleSetup::simplifySolution().
  CheckCount count;          ///< In search and simplification.
  double length = 0.0;       ///< Of the simplified path, in the space of joints, rad and m alike.
  std::vector<double> path;  ///< Simplified: n x dof, row by row; empty where there is none.
  /// Simplification left it in collision at points that OMPL tests, of which OMPL only warns.
  bool is_broken = false;
};

/// Looks for a path for up to `limit_s` seconds, and simplifies it, which knows no limit. OMPL's
/// random numbers and output are the caller's (session.hpp). Throws what OMPL does.
[[nodiscard]] PlainAnswer plan_plainly(const std::shared_ptr<const RobotModel>& robot,
                                       const Scene& scene, const Eigen::VectorXd& q_start,
                                       const Eigen::VectorXd& q_goal, double margin_m,
                                       double limit_s);

}  // namespace sidestep::plain_driver
