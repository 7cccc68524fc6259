#pragma once

#include <array>
#include <string>
#include <vector>

#include <sidestep/core/export.hpp>
#include <sidestep/geometry/shape.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep {

/// Many convex bodies of one kind, as one object: the cells of a map, the balls about the points of
/// a cloud.
struct Swarm {
  enum class Kind { kCubes, kBalls };
  struct Member {
    Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
    double size_m = 0.0;  ///< Edge of a cube, radius of a ball.
  };
  std::string name;
  Kind kind = Kind::kCubes;
  std::vector<Member> members;
};

/// Of the items of a body those from `first` on, before `last`. The halves of halves of all of them
/// are numbered: those of `node` are 2 * node and 2 * node + 1.
struct Share {
  std::size_t node = 1;
  std::size_t first = 0;
  std::size_t last = 1;

  [[nodiscard]] bool is_single() const { return last - first == 1; }
  [[nodiscard]] std::array<Share, 2> halves() const {
    const std::size_t middle = (first + last) / 2;
    return {{{2 * node, first, middle}, {2 * node + 1, middle, last}}};
  }
};

/// What may touch: a convex shape (one item), the triangles of a mesh, or the members of a swarm.
/// Items are so ordered that the halves of halves of them lie close together. What is asked of a
/// share of them is asked of its convex hull.
class SIDESTEP_EXPORT Body {
 public:
  explicit Body(const Shape& shape);
  explicit Body(const Swarm& swarm);

  [[nodiscard]] Share all() const { return {1, 0, count_}; }
  /// A point of a share that is farthest along a direction; both in the body's frame.
  [[nodiscard]] Eigen::Vector3d farthest(const Share& share, const Eigen::Vector3d& along) const;
  /// Of a ball about its origin that holds it; of no swarm.
  [[nodiscard]] double reach_m() const { return reach_m_; }
  [[nodiscard]] Eigen::Vector3d centre(const Share& share) const;
  /// Half of the diagonal of the bounding box of more than one item; of one, 0.
  [[nodiscard]] double extent_m(const Share& share) const;
  [[nodiscard]] bool is_half_space() const;
  /// Whether a point is in the bounding box of all items.
  [[nodiscard]] bool may_hold(const Eigen::Vector3d& p) const;
  /// A point of each item.
  [[nodiscard]] std::vector<Eigen::Vector3d> points() const;

  [[nodiscard]] const Shape& shape() const { return shape_; }
  /// Of a mesh, in the order of the items; else none.
  [[nodiscard]] const std::vector<Eigen::Vector3i>& triangles() const { return triangles_; }
  /// Of a swarm, in the order of the items; else none.
  [[nodiscard]] const std::vector<Swarm::Member>& members() const { return members_; }
  [[nodiscard]] Swarm::Kind kind() const { return kind_; }
  /// Whether it is a mesh that has an inside: each side of a triangle is one other's, the other
  /// way round.
  [[nodiscard]] bool is_closed_mesh() const { return is_closed_mesh_; }

 private:
  struct Bounds {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    Eigen::Vector3d half = Eigen::Vector3d::Zero();
  };
  template <class Item>
  void arrange(std::vector<Item>& items);
  [[nodiscard]] Bounds bounds_of(const Eigen::Vector3i& triangle) const;
  [[nodiscard]] Bounds bounds_of(const Swarm::Member& member) const;
  template <class Item>
  void arrange(std::vector<Item>& items, const Share& share);
  [[nodiscard]] Eigen::Vector3d farthest_of(std::size_t item, const Eigen::Vector3d& along) const;

  Shape shape_;
  const Mesh* mesh_ = nullptr;
  std::vector<Eigen::Vector3i> triangles_;
  std::vector<Swarm::Member> members_;
  Swarm::Kind kind_ = Swarm::Kind::kCubes;
  std::size_t count_ = 1;
  double reach_m_ = 0.0;
  bool is_closed_mesh_ = false;
  std::vector<Bounds> bounds_;  ///< By number of the share.
};

/// A share of a body in the world.
struct PlacedBody {
  const Body* body = nullptr;
  Share share;
  Transform T_world_body = Transform::Identity();

  [[nodiscard]] Eigen::Vector3d farthest(const Eigen::Vector3d& along) const;
  [[nodiscard]] Eigen::Vector3d centre() const { return T_world_body * body->centre(share); }
};

/// How far apart two are along a direction from `a` to `b`, at least: no more than their distance,
/// whatever the direction. A half-space may be `b`.
[[nodiscard]] double gap_m(const PlacedBody& a, const PlacedBody& b,
                           const Eigen::Vector3d& direction);

/// Two points, one of each.
struct NearestPoints {
  Eigen::Vector3d p_a = Eigen::Vector3d::Zero();
  Eigen::Vector3d p_b = Eigen::Vector3d::Zero();
  bool overlap = false;  ///< The two points are the same, to 1e-9 m.
  /// From `a` to `b`: that along which they were seen farthest apart, if they were at all. Rounding
  /// may keep the line between the points from being that.
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  double apart_m = 0.0;  ///< Along that.

  [[nodiscard]] double distance_m() const { return overlap ? 0.0 : (p_b - p_a).norm(); }
};
/// As near as can be found, by the algorithm of Gilbert, Johnson and Keerthi (1988). Of two that
/// are more than `near_m` apart it may end sooner, once it is known whether they are more than
/// `wanted_m` apart. It begins along a direction from `a` to `b`.
[[nodiscard]] NearestPoints nearest_points(const PlacedBody& a, const PlacedBody& b, double near_m,
                                           double wanted_m, const Eigen::Vector3d& along);

}  // namespace sidestep
