#pragma once

#include <vector>

#include <sidestep/planning/state_normals.hpp>

#include "difference_metric.hpp"
#include "penalty_qp.hpp"
#include "swept_contacts.hpp"
#include "waypoint_terms.hpp"

namespace sidestep {

/// What a path costs with obstacles as penalties.
struct Merit {
  double cost = 0.0;  ///< Smoothness and the problem's other terms.
  double shortfall_m =
      0.0;               ///< Sum over all swept contacts of what they lack of the distance kept.
  double worst_m = 0.0;  ///< The largest of them.

  [[nodiscard]] double value(double penalty) const noexcept { return cost + penalty * shortfall_m; }
};

/// The problem at a path, as it is and as a convex one: smoothness as it is, the problem's terms by
/// Gauss-Newton, and for every swept contact the hinge penalty * max(0, keep - clearance),
/// clearance linear in the waypoints (Schulman 2014, eq. 15). Where start or goal hold a sphere
/// nearer than that, it is to keep what it has there on the way to the next waypoint. One thread at
/// a time.
class ConvexModel {
 public:
  /// `keep_m`: clearance that spheres are to keep; `reach_m`: contacts of less are modelled.
  /// Problem and metric must outlive the object.
  ConvexModel(const Problem& problem, const DifferenceMetric& metric, double smoothness_weight,
              double keep_m, double reach_m);

  [[nodiscard]] WaypointStates& states() noexcept { return states_; }

  /// Of waypoints, which it leaves in states().
  [[nodiscard]] Merit evaluate(const Waypoints& positions);

  /// The change of the merit with steps of the inner waypoints, joint by joint from the first
  /// waypoint to the last. Bounds are left to the caller.
  [[nodiscard]] PenaltyQp convexify(const Waypoints& positions, double penalty);

 private:
  void add_smoothness(const Waypoints& positions, PenaltyQp& qp) const;
  void add_terms(PenaltyQp& qp);
  void add_contacts(double penalty, PenaltyQp& qp);
  /// What a contact is to keep: beside an end no more than its sphere has there.
  [[nodiscard]] double keep_m(const SweptContact& contact) const;
  /// The variable of a joint at a waypoint; -1 at the ends.
  [[nodiscard]] int variable(int waypoint, int joint) const noexcept;

  const Problem* problem_;
  const DifferenceMetric* metric_;
  double smoothness_weight_;
  double keep_m_, reach_m_;
  WaypointStates states_;
  WaypointTerms terms_;
  SweptContacts swept_;
  StateNormals normals_;
  BandMatrix zeros_;
  std::vector<LinkForce> forces_;
  std::vector<double> rows_[2];
  Scratch scratch_;
};

}  // namespace sidestep
