#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/index.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/field/dense_field.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/robot/robot_model.hpp>

#include "motion_bounds.hpp"

namespace sidestep {

/// A path of configurations over one parameter (seconds, or a fraction of a straight line).
class Motion {
 public:
  virtual ~Motion() = default;
  virtual void configuration(double t, std::span<double> q) const = 0;
  /// Length of each joint's way between two parameters, there and back counted both.
  virtual void variation(double from, double to, std::span<double> v) const = 0;
};

/// What the prover measures: items [0, spheres) are the robot's spheres against the field and the
/// floor, the rest, if not only obstacles are looked for, its self_collision_pairs.
struct ClearanceReading {
  /// Distance minus radius under the space policy, the nearer of both; in the field with what a
  /// sphere is allowed that leaves an obstacle, as in `smooth_m`.
  double clearance_m = 0.0;
  double smooth_m = 0.0;       ///< Of the field alone, without the policy: what drop(L) is about.
  double floor_m = kInfinity;  ///< Above the floor.
  double inside_m = 0.0;       ///< Of the centre to the field's border; negative outside.
  FieldStatus status = FieldStatus::kKnown;
  bool is_unseen = false;  ///< The centre is where no frame has seen, and may not be there.
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
};

/// By how much a bound on the clearance falls short of what is required; at most 0 where it does
/// not.
struct Shortfall {
  Shortfall(double amount, bool to_floor = false) : amount_m(amount), is_to_floor(to_floor) {}
  double amount_m;
  bool is_to_floor;  ///< The clearance above the floor, rather than that in the field.
};

/// Shows that a motion keeps clear between checks, or where it does not (numerics:
/// continuous-time validity). Let L bound the way of a sphere's centre between two checks at
/// which its clearances are a and b. The interpolated field falls by at most drop(L) along it,
/// so the clearance in between is at least (a + b - drop(L)) / 2; where that is less than
/// required, the interval is halved, for that sphere alone, until L is below `min_step_m`.
///
/// drop(L) = min(sqrt(3) L, L + sqrt(3) resolution): distances at voxel centres are
/// 1-Lipschitz, so every partial derivative of their trilinear interpolant is at most 1; and
/// the interpolant differs from the true distance by at most sqrt(3)/2 resolution. A signed
/// field jumps by two voxels across a surface, which doubles both for spheres that may come
/// that near. The field itself is taken to be exact.
///
/// A sphere that leaves an obstacle (SpacePolicy::leaving) is read with what it is allowed there,
/// which falls by half of L, too.
///
/// A height above the floor falls by at most L, in the map and outside it alike.
///
/// Where unknown space counts as occupied, or the sphere is of a link that keeps to observed space,
/// all voxels within L/2 of the middle of the two centres must be known, too; where the outside
/// does, the centre must stay inside.
class ClearanceProver {
 public:
  /// `bounds` are the robot's.
  ClearanceProver(std::shared_ptr<const RobotModel> robot,
                  std::shared_ptr<const MotionBounds> bounds,
                  std::shared_ptr<const DistanceField> field, SpacePolicy space, double margin_m,
                  bool obstacles_only = false);

  /// Hears what the prover finds; returning false ends the proof.
  class Listener {
   public:
    virtual ~Listener() = default;
    virtual bool on_reading(double t, int item, const ClearanceReading& reading) = 0;
    /// Not shown clear around t.
    virtual bool on_unproven(double t, int item, const Shortfall& shortfall) = 0;
  };

  struct Request {
    const Motion& motion;
    double from = 0.0;
    double to = 0.0;          ///< Equal to `from`: that instant alone.
    double max_step_m = 0.0;  ///< First spacing of checks, as motion of spheres.
    double min_step_m = 0.0;  ///< Halving ends here.
    /// At `from` the robot is where the last proof in this workspace ended: what was read there
    /// need not be read again.
    bool goes_on = false;
    bool keeps_to_observed = true;  ///< Whether the policy's observed space holds for this motion.
  };

  /// The temporaries of a proof, one per thread.
  struct Workspace;
  using WorkspacePtr = std::shared_ptr<Workspace>;
  [[nodiscard]] WorkspacePtr make_workspace() const;

  enum class End { kFinished, kStopped, kDeadline };
  End prove(const Request& request, Listener& listener, const Deadline& deadline,
            Workspace& workspace) const;

  /// Readings of all items at one configuration.
  void read(std::span<const double> q, std::span<ClearanceReading> readings,
            Workspace& workspace) const;

  /// At least the way of every item for these variations of the joints.
  [[nodiscard]] double way_bound_m(std::span<const double> variation) const noexcept;

  [[nodiscard]] int sphere_count() const noexcept { return sphere_count_; }
  [[nodiscard]] int item_count() const noexcept { return sphere_count_ + pair_count_; }
  /// Clearance that an item must keep.
  [[nodiscard]] double required_m(int item) const noexcept {
    return item < sphere_count_ ? margin_m_ : 0.0;
  }
  [[nodiscard]] bool violates(int item, const ClearanceReading& reading) const noexcept;
  /// Whether a sphere's clearance is no more than the field's own limit: it may be larger.
  [[nodiscard]] bool is_at_limit(int item, const ClearanceReading& reading) const noexcept;
  [[nodiscard]] const RobotModel& robot() const noexcept { return *robot_; }
  /// By joint, of all items.
  [[nodiscard]] std::span<const double> largest_levers() const noexcept { return largest_levers_; }
  [[nodiscard]] const SpacePolicy& space() const noexcept { return space_; }

 private:
  struct Interval;
  struct Gap;
  struct Measurement;

  /// Bound on the way of an item for the variations and levers in the workspace.
  [[nodiscard]] double way_m(int item, const Workspace& workspace) const noexcept;
  [[nodiscard]] double longest_way_m(const Workspace& workspace) const noexcept;
  /// How many pieces with levers of their own a motion is worth; 0 if it is absurdly long.
  [[nodiscard]] int piece_count(const Request& request, Workspace& workspace) const;
  /// All items at workspace.times; false if the listener ends it.
  bool measure_all(const Motion& motion, Listener& listener, Workspace& workspace) const;
  /// The same between the pieces of a motion and at its ends, into workspace.piece_ends.
  bool measure_ends(const Request& request, int pieces, Listener& listener,
                    Workspace& workspace) const;
  /// False if the listener ends it.
  bool measure_and_tell(Listener& listener, Workspace& workspace) const;
  void measure(Workspace& workspace) const;
  void measure_spheres(Workspace& workspace) const;
  void measure_pairs(Workspace& workspace) const;
  [[nodiscard]] double fall_m(int item, double way_m) const noexcept;
  [[nodiscard]] double leaving_depth_m(int item) const noexcept;
  [[nodiscard]] double allowance_m(int item, const Eigen::Vector3d& centre_m) const noexcept;
  /// Between two readings of an item, for a bound on its way from one to the other.
  [[nodiscard]] Shortfall shortfall(int item, const ClearanceReading& a, const ClearanceReading& b,
                                    double way_m, Workspace& workspace) const;
  [[nodiscard]] double field_shortfall_m(int item, const ClearanceReading& a,
                                         const ClearanceReading& b, double way_m,
                                         Workspace& workspace) const;
  [[nodiscard]] bool stays_known(int item, const ClearanceReading& a, const ClearanceReading& b,
                                 double way_m, Workspace& workspace) const;
  /// Whether a sphere's centre may not be in this voxel if it is unknown.
  [[nodiscard]] bool must_be_known(int item, const Eigen::Vector3d& voxel_m,
                                   const Workspace& workspace) const noexcept;
  /// Whether there are such voxels.
  [[nodiscard]] bool keeps_to_known(int item, const Workspace& workspace) const noexcept;
  [[nodiscard]] bool is_settled(int item, const ClearanceReading& a, const ClearanceReading& b,
                                Workspace& workspace) const;
  bool open_piece(const Request& request, int piece, Listener& listener,
                  Workspace& workspace) const;
  bool sift(const Request& request, Listener& listener, Workspace& workspace) const;
  bool halve(const Request& request, Listener& listener, Workspace& workspace) const;

  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const DistanceField> field_;
  const DenseField* dense_ = nullptr;  ///< field_, if it is one: tells known voxels at once.
  SpacePolicy space_;
  FloorClearance above_floor_;
  double margin_m_ = 0.0;
  std::shared_ptr<const MotionBounds> bounds_;
  int sphere_count_ = 0;
  int pair_count_ = 0;
  std::vector<std::vector<int>> spheres_of_link_;
  std::vector<double> radius_m_;
  std::vector<bool> keeps_to_observed_;  // spheres
  std::vector<bool> fixed_;              ///< Spheres that are not looked at; empty: none.
  std::vector<double> largest_levers_;
  std::vector<double> fall_factor_;  // spheres: 1, or 2 near the surface of a signed field
};

/// Keeps the worst violation of each subject and kind, and turns them into a verdict.
class ViolationLedger {
 public:
  void add(Violation violation);
  /// Adds what a position is beyond its limits, by more than a tolerance; or if it is no number.
  void check_position(const Joint& joint, double tolerance, double position, double time_s);
  [[nodiscard]] bool empty() const noexcept { return violations_.empty(); }
  /// The earliest time of all that were added; infinity if none was.
  [[nodiscard]] double first_s() const noexcept { return first_s_; }
  /// Worst first: collisions, self-collisions, limits, unproven; the larger amount first.
  [[nodiscard]] std::vector<Violation> sorted() const;

 private:
  std::vector<Violation> violations_;
  double first_s_ = kInfinity;
};

inline constexpr const char* kObstacle = "an obstacle";
inline constexpr const char* kUnknownSpace = "unknown space";
/// kObstacle, or what else a point is in that counts as occupied under the policy.
[[nodiscard]] std::string obstacle_name(FieldStatus status, const SpacePolicy& space);

/// The violation that a reading of a sphere or of a pair of links amounts to.
[[nodiscard]] Violation violation_of(const ClearanceProver& prover, int item,
                                     const ClearanceReading& reading, double time_s);
/// An item whose motion could not be shown clear.
[[nodiscard]] Violation unproven(const ClearanceProver& prover, int item,
                                 const Shortfall& shortfall, double time_s);

/// "its upper limit of 2.617 rad" and the like; `per` is "", "/s" or "/s^2".
[[nodiscard]] std::string limit_name(const Joint& joint, std::string_view which, double value,
                                     std::string_view per);

}  // namespace sidestep
