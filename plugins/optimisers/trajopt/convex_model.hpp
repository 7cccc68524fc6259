#pragma once

#include <vector>

#include <sidestep/core/scratch.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/state_normals.hpp>

#include "penalty_qp.hpp"
#include "waypoints.hpp"

namespace sidestep {

/// Where a sphere, swept from one state to the next, comes nearest to an obstacle or the floor.
struct SweptContact {
  int state = 0;  ///< The earlier of the two.
  std::size_t sphere = 0;
  double fraction = 0.0;     ///< Of the way between them, [0, 1].
  double clearance_m = 0.0;  ///< A lower bound on that of the whole motion between them,
  double slack_m = 0.0;      ///< which falls short of the clearance at `fraction` by this at most.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< Gradient of the clearance there.
};

/// Continuous-time collision of a problem's robot by swept spheres (after Schulman 2014, section
/// V-B): between two neighbouring states a sphere sweeps a capsule, and what is judged is the least
/// distance along the capsule's axis. A field that is a distance cannot fall by more than the way
/// along the axis, which bounds it between two points that are looked at; the worst gap is halved
/// until the bound is tight. How far the centre's way departs from the axis is taken from the
/// second differences of its places, and counts as lost clearance. One thread at a time.
class SweptContacts {
 public:
  static constexpr double kSearch_m = 0.002;

  /// The problem must outlive the object.
  explicit SweptContacts(const Problem& problem);

  /// All contacts of less than `reach_m`, in order of states. Valid until the next call.
  [[nodiscard]] const std::vector<SweptContact>& find(const WaypointStates& states, double reach_m);

  /// The clearance of a sphere at a state, as of the last find().
  [[nodiscard]] double clearance_m(int state, std::size_t sphere) const;
  /// Centres of all spheres of a state, as of the last find().
  [[nodiscard]] const Eigen::Vector3d& centre_m(int state, std::size_t sphere) const {
    return centres_m_[static_cast<std::size_t>(state) * spheres_ + sphere];
  }

 private:
  void look(const WaypointStates& states);
  /// Adds the contact of one swept sphere with the field, if it is one.
  void sweep(int state, std::size_t sphere, double reach_m);
  void drop(int state, std::size_t sphere, double reach_m);
  [[nodiscard]] double departure_m(std::size_t point, std::size_t next) const;

  const Problem* problem_;
  FloorClearance floor_;
  std::size_t spheres_;
  std::vector<double> radius_m_;
  std::vector<Eigen::Vector3d> centres_m_;
  std::vector<double> distances_m_;
  std::vector<FieldStatus> statuses_;
  std::vector<SweptContact> contacts_;
  Scratch scratch_;
};

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
