#include "body_cells.hpp"

#include <algorithm>
#include <cmath>
#include <queue>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// Boxes in the depth: half diagonal at most this share of the depth.
constexpr double kDepthShare = 0.3;
/// Of boxes, halved to find the radius of one sphere.
constexpr int kMostHalvings = 4000;
constexpr double kRadiusTolerance_m = 2e-5;

/// Both halves of a box across its longest side.
std::pair<Cell, Cell> halves(const Cell& cell) {
  int longest = 0;
  cell.half_m.maxCoeff(&longest);
  Cell low = cell;
  low.half_m[longest] *= 0.5;
  Cell high = low;
  low.p_shape[longest] -= low.half_m[longest];
  high.p_shape[longest] += high.half_m[longest];
  return {low, high};
}

class CellMaker {
 public:
  CellMaker(const RigidBody& body, const Held& held, double fine_m, std::size_t most)
      : body_(body), held_(held), fine_m_(fine_m), most_(most) {}

  /// False where there are too many.
  bool add(const Cell& cell) {
    const BodyPart& part = body_.parts[idx(cell.part)];
    const double radius = cell.half_m.norm();
    const double distance = signed_distance_m(part.shape, cell.p_shape);
    if (distance > radius || is_held(cell, radius)) return true;
    if (radius <= std::max(fine_m_, -kDepthShare * distance)) {
      cells_.push_back(cell);
      return cells_.size() <= most_;
    }
    const auto [low, high] = halves(cell);
    return add(low) && add(high);
  }

  [[nodiscard]] std::vector<Cell> take() { return std::move(cells_); }

 private:
  [[nodiscard]] bool is_held(const Cell& cell, double radius) const {
    const Eigen::Vector3d p_body = body_.parts[idx(cell.part)].T_body_shape * cell.p_shape;
    const auto holds = [&](const BodySphere& sphere) {
      return (p_body - sphere.p_body).norm() + radius <= sphere.radius_m;
    };
    if (std::ranges::any_of(held_.spheres, holds)) return true;
    for (std::size_t other = 0; other < body_.parts.size(); ++other) {
      const BodyPart& part = body_.parts[other];
      // Of two shapes of one link that overlap, the first holds what both have.
      const bool is_before =
          part.link == body_.parts[idx(cell.part)].link && other < idx(cell.part);
      if (!is_before && std::ranges::count(held_.links, part.link) == 0) continue;
      if (signed_distance_m(part.shape, part.T_shape_body * p_body) <= -radius) return true;
    }
    return false;
  }

  const RigidBody& body_;
  const Held& held_;
  double fine_m_;
  std::size_t most_;
  std::vector<Cell> cells_;
};

}  // namespace

std::vector<Cell> link_cells(const RigidBody& body, int link, const Held& held, double fine_m,
                             std::size_t most) {
  for (;; fine_m *= 1.5) {
    CellMaker maker(body, held, fine_m, most);
    bool fits = true;
    for (std::size_t part = 0; fits && part < body.parts.size(); ++part) {
      if (body.parts[part].link != link) continue;
      const ShapeBounds bounds = bounds_of(body.parts[part].shape);
      fits = maker.add({static_cast<int>(part), bounds.centre_m, bounds.half_m});
    }
    if (fits) return maker.take();
  }
}

double radius_to_hold_m(const RigidBody& body, std::span<const Cell> cells,
                        const Eigen::Vector3d& p_body) {
  struct Reach {
    double far_m;
    Cell cell;
    bool operator<(const Reach& other) const { return far_m < other.far_m; }
  };
  const auto reach = [&](const Cell& cell) {
    return Reach{farthest_m(cell, body.parts[idx(cell.part)].T_shape_body * p_body), cell};
  };
  std::priority_queue<Reach> queue;
  for (const Cell& cell : cells) queue.push(reach(cell));
  for (int halving = 0; halving < kMostHalvings && !queue.empty(); ++halving) {
    const Cell farthest = queue.top().cell;
    const double radius = farthest.half_m.norm();
    const Shape& shape = body.parts[idx(farthest.part)].shape;
    // Of a box that lies in the shape as a whole, that corner is the shape's.
    if (radius < kRadiusTolerance_m || std::holds_alternative<Box>(shape)) break;
    if (signed_distance_m(shape, farthest.p_shape) <= -radius) break;
    queue.pop();
    const auto [low, high] = halves(farthest);
    for (const Cell& half : {low, high}) {
      if (signed_distance_m(shape, half.p_shape) <= half.half_m.norm()) queue.push(reach(half));
    }
  }
  return queue.empty() ? 0.0 : queue.top().far_m;
}

}  // namespace sidestep
