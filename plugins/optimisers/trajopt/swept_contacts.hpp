#pragma once

#include <vector>

#include <sidestep/core/scratch.hpp>
#include <sidestep/planning/costs.hpp>

#include "waypoint_states.hpp"

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

}  // namespace sidestep
