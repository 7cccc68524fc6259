#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/core/lanes.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep::detail {

/// A cubic piece of a path, q0 + v0 s + c2 s^2 + c3 s^3: a row of joints for each coefficient, in
/// whole lanes, with zeros beyond the joints.
struct CubicLanes {
  const double* rows = nullptr;
  std::size_t width = 0;

  static constexpr std::size_t kRows = 4;
  [[nodiscard]] const double* q0() const noexcept { return rows; }
  [[nodiscard]] const double* v0() const noexcept { return rows + width; }
  [[nodiscard]] const double* c2() const noexcept { return rows + 2 * width; }
  [[nodiscard]] const double* c3() const noexcept { return rows + 3 * width; }
};

/// The path of a trajectory, cut into short stages, with what a parameterisation by arc length l
/// needs of it: dq/dl and d2q/dl2 at both ends of each stage. The arc length is that of joint
/// space, metres and radians alike; it only serves as parameter.
///
/// A stage lies within one cubic piece, so that its two ends see that piece's own curvature; the
/// next stage sees its own at the same point, since the acceleration of a Gaussian-process
/// trajectory jumps at its support states.
///
/// Where two pieces meet at an angle too small to stop at, a state in the corner would have two
/// velocities. There one stage reaches from before it to behind it, as far on both sides, and what
/// it sees as curvature is how much the path turns on its length.
class PathStages {
 public:
  /// Directions that agree this well are one, or meet at a corner that is no stop: cos 1 degree.
  static constexpr double kSameDirection = 0.9998;

  struct Stage {
    int piece = 0;        ///< In which it begins,
    int to_piece = 0;     ///< and in which it ends: the same but for one around a corner.
    double from_s = 0.0;  ///< Within the pieces.
    double to_s = 0.0;
    bool is_corner = false;
    double corner_s = 0.0;  ///< Within the piece in which it begins.
    /// The path's own speed vanishes at this end; its direction there is the limit within the
    /// stage.
    bool still_from = false;
    bool still_to = false;
    bool stop_from = false;  ///< The path begins, ends or turns on the spot here.
    bool stop_to = false;
    double length = 0.0;
  };

  /// `path` is sound and stays alive.
  PathStages(const Trajectory& path, int least_stages);

  [[nodiscard]] int size() const noexcept { return static_cast<int>(stages_.size()); }
  [[nodiscard]] const Stage& operator[](int i) const noexcept { return stages_[idx(i)]; }
  [[nodiscard]] double length() const noexcept { return length_; }

  [[nodiscard]] std::span<const double> tangent_from(int i) const { return row(i, 0); }
  [[nodiscard]] std::span<const double> curvature_from(int i) const { return row(i, 1); }
  [[nodiscard]] std::span<const double> tangent_to(int i) const { return row(i, 2); }
  [[nodiscard]] std::span<const double> curvature_to(int i) const { return row(i, 3); }

  /// The path's position at both ends of stage `i`.
  void position_from(int i, std::span<double> q) const {
    position(stages_[idx(i)].piece, stages_[idx(i)].from_s, q);
  }
  void position_to(int i, std::span<double> q) const {
    position(stages_[idx(i)].to_piece, stages_[idx(i)].to_s, q);
  }
  /// The largest distance of any joint of `q` from the path's nearest point within stage `i`.
  [[nodiscard]] double distance(int i, std::span<const double> q) const;
  /// When stage `i` begins, on the clock of the path's trajectory.
  [[nodiscard]] double begin_s(int i) const;

  /// How many stages halve() makes of stage `i`: of one around a corner the outer halves of both
  /// of its sides, and what is left.
  [[nodiscard]] int parts_of(int i) const { return stages_[idx(i)].is_corner ? 3 : 2; }
  /// Changes with the stages.
  [[nodiscard]] std::int64_t version() const noexcept { return version_; }
  /// Halves the stages that are marked.
  void halve(const std::vector<char>& marks);

 private:
  [[nodiscard]] CubicLanes cubic(int piece) const noexcept {
    return {cubics_.data() + idx(piece) * CubicLanes::kRows * width_, width_};
  }
  [[nodiscard]] std::size_t row_at(int stage, std::size_t which) const noexcept {
    return (idx(stage) * kRows + which) * width_;
  }
  [[nodiscard]] std::span<const double> row(int stage, std::size_t which) const noexcept {
    return std::span(rows_).subspan(row_at(stage, which), dof_);
  }
  void position(int piece, double s, std::span<double> q) const;
  /// Where the second side of a stage around a corner begins, within the piece in which it ends.
  [[nodiscard]] static double behind_corner_s(const Stage& stage) noexcept {
    return stage.to_piece == stage.piece ? stage.corner_s : 0.0;
  }
  [[nodiscard]] double length_of(const Stage& stage) const noexcept;
  /// Where in a piece the path has gone so far from `from_s`, at most to `to_s`.
  [[nodiscard]] double place_s(int piece, double from_s, double to_s, double way) const noexcept;
  /// The largest distance of any joint of `q` from the nearest point of a part of a piece.
  [[nodiscard]] double distance(int piece, double from_s, double to_s,
                                std::span<const double> q) const;
  /// Writes the rows of one end of a stage.
  void derive_from(int stage);
  void derive_to(int stage);
  void derive(const Stage& stage, bool at_end, double* tangent, double* curvature) const;
  [[nodiscard]] double take_piece(int piece, int begin);
  void cut_piece(int piece, int parts);
  void append(Stage stage, int depth);
  void push(const Stage& stage);
  void push_parts(const Stage& stage);
  void mark_stops();
  [[nodiscard]] bool is_corner_behind(int i) const;
  [[nodiscard]] std::vector<double> ways_around_corners() const;
  [[nodiscard]] std::optional<Stage> rest_of(const Stage& stage, double before,
                                             double behind) const;
  void span_corners();

  const Trajectory& path_;
  std::size_t dof_;
  std::size_t width_;    ///< Of a row: the joints in whole lanes.
  AlignedArray cubics_;  ///< Pieces x coefficients x joints.
  std::vector<Stage> stages_;
  static constexpr std::size_t kRows = 4;
  std::vector<double> rows_;  ///< Stages x (tangent, curvature at either end) x joints.
  double length_ = 0.0;
  std::int64_t version_ = 0;
};

/// Where and why a path cannot be followed.
struct Obstruction {
  int stage = 0;
  bool at_goal = false;  ///< The goal's velocity is the trouble, else the start's.
};

/// The fastest x = (dl/dt)^2 along a path of arc length l under limits: at each stage u = d2l/dt2
/// is constant, so that x changes by 2 u length, and at both of its ends
///
///     |dq/dl| sqrt(x) <= velocity     |dq/dl u + d2q/dl2 x| <= acceleration
///
/// for every joint (Pham and Pham 2018, with constraints at both ends of a stage). In a stop,
/// joints that lose speed may do so by the limits of braking.
class SpeedProfile {
 public:
  /// Shares of the limits that each stage may use, (0, 1].
  struct Shares {
    std::vector<double> velocity;
    std::vector<double> acceleration;
  };

  /// `limits` hold infinity for joints that never move. In a stop, joints lose speed by their
  /// while_stopping().
  SpeedProfile(const PathStages& stages, const MotionLimits& limits, bool is_stop)
      : stages_(stages), limits_(limits), is_stop_(is_stop) {}

  /// Finds x at the ends of all stages from `x_start` to `x_goal`; false where there is none, and
  /// obstruction() says why.
  [[nodiscard]] bool solve(double x_start, double x_goal, const Shares& shares);

  struct Rest {
    int stage = 0;
    double share = 0.0;  ///< Of the stage's length.
  };
  /// Where the path stands still when it is braked hardest from `x_start`, with so much of the
  /// acceleration limits; nothing where it ends before, or cannot be braked so within them.
  [[nodiscard]] std::optional<Rest> braking_end(double x_start, double acceleration_share);

  /// One value more than there are stages.
  [[nodiscard]] const std::vector<double>& x() const noexcept { return x_; }
  [[nodiscard]] const Obstruction& obstruction() const noexcept { return obstruction_; }

 private:
  /// offset + slope x.
  struct Line {
    double offset = 0.0;
    double slope = 0.0;
    [[nodiscard]] double operator()(double x) const noexcept { return offset + slope * x; }
  };
  struct Bounds {
    Line lower, upper;  ///< Of u: the ones that bind at an x.
  };
  struct Interval {
    double low = 0.0;
    double high = 0.0;
  };

  [[nodiscard]] std::size_t strip_rows() const noexcept { return is_stop_ ? 6 : 4; }
  void load_limits();
  void load_strips();
  void load(int stage, double acceleration_share);
  [[nodiscard]] Bounds bounds(double x) const noexcept;
  /// The values of x from which some u leads into [next_low_, next_high_].
  [[nodiscard]] std::optional<Interval> controllable(double x_max) const noexcept;
  void limit_speeds(const Shares& shares);
  [[nodiscard]] bool pass_backward(double x_goal, const Shares& shares);
  void pass_forward(double x_start, const Shares& shares);
  [[nodiscard]] int where_braking_fails(double x_start, const Shares& shares);

  const PathStages& stages_;
  const MotionLimits& limits_;
  bool is_stop_;
  std::vector<double> fastest_;  ///< Per node: x that the velocity limits allow.
  std::vector<Interval> reach_;  ///< Per node: x from which the goal can be reached.
  std::vector<double> x_;
  Obstruction obstruction_;

  std::size_t width_ = 0;          ///< Of a row: the joints in whole lanes.
  AlignedArray rows_;              ///< Of joints, in whole lanes: three of limits.
  AlignedArray strips_;            ///< Stages x four such rows; six in a stop.
  std::vector<double> most_x_of_;  ///< Per stage: what joints that do not feel u allow.
  std::int64_t version_ = 0;       ///< Of the stages that these are of.

  // Of the stage that is loaded.
  const double* widths_ = nullptr;  ///< And its slopes.
  const double* losses_ = nullptr;  ///< Widths below, where joints lose speed.
  double share_ = 0.0;              ///< Of the acceleration limits.
  double most_x_ = 0.0;             ///< What joints that do not feel u allow.
  double twice_length_ = 0.0;
  Interval next_;
};

}  // namespace sidestep::detail
