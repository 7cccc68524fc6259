#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <sidestep/core/lanes.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "cubic_lanes.hpp"

namespace sidestep::detail {

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
  [[nodiscard]] const Stage& operator[](int i) const noexcept { return stages_[at(i)]; }
  [[nodiscard]] double length() const noexcept { return length_; }

  [[nodiscard]] std::span<const double> tangent_from(int i) const { return row(i, 0); }
  [[nodiscard]] std::span<const double> curvature_from(int i) const { return row(i, 1); }
  [[nodiscard]] std::span<const double> tangent_to(int i) const { return row(i, 2); }
  [[nodiscard]] std::span<const double> curvature_to(int i) const { return row(i, 3); }

  /// The path's position at both ends of stage `i`.
  void position_from(int i, std::span<double> q) const {
    position(stages_[at(i)].piece, stages_[at(i)].from_s, q);
  }
  void position_to(int i, std::span<double> q) const {
    position(stages_[at(i)].to_piece, stages_[at(i)].to_s, q);
  }
  /// The largest distance of any joint of `q` from the path's nearest point within stage `i`.
  [[nodiscard]] double distance(int i, std::span<const double> q) const;
  /// When stage `i` begins, on the clock of the path's trajectory.
  [[nodiscard]] double begin_s(int i) const;

  /// How many stages halve() makes of stage `i`: of one around a corner the outer halves of both
  /// of its sides, and what is left.
  [[nodiscard]] int parts_of(int i) const { return stages_[at(i)].is_corner ? 3 : 2; }
  /// Changes with the stages.
  [[nodiscard]] std::int64_t version() const noexcept { return version_; }
  /// Halves the stages that are marked.
  void halve(const std::vector<char>& marks);

 private:
  static std::size_t at(int i) noexcept { return static_cast<std::size_t>(i); }
  [[nodiscard]] CubicLanes cubic(int piece) const noexcept {
    return {cubics_.data() + at(piece) * CubicLanes::kRows * width_, width_};
  }
  [[nodiscard]] std::size_t row_at(int stage, std::size_t which) const noexcept {
    return (at(stage) * kRows + which) * width_;
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

}  // namespace sidestep::detail
