#include "solid_cover.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <utility>

#include <Eigen/Geometry>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// Cells at the surface: half diagonal, as a share of the protrusion.
constexpr double kFineShare = 0.2;
/// Cells in the depth: half diagonal at most this share of the depth.
constexpr double kDepthShare = 0.3;
/// Cells to begin with; coarser ones where that is too few.
constexpr std::size_t kMostCells = 10'000;
constexpr double kCoarser = 1.4;
/// A ball that stands out by so many protrusions is not worth a better place.
constexpr double kHopeless = 4.0;
constexpr double kLeastStepShare = 0.01;  // of the protrusion
constexpr double kLeastCellShare = 0.02;  // likewise

/// A box along the axes of the shape's frame that holds some of the shape.
struct Cell {
  Eigen::Vector3d p_shape;
  Eigen::Vector3d half_m;
};

std::array<Cell, 2> halves(const Cell& cell) {
  int longest = 0;
  cell.half_m.maxCoeff(&longest);
  Cell low = cell;
  low.half_m[longest] *= 0.5;
  Cell high = low;
  low.p_shape[longest] -= low.half_m[longest];
  high.p_shape[longest] += high.half_m[longest];
  return {low, high};
}

double farthest_m(std::span<const Cell> cells, const Eigen::Vector3d& p) {
  double farthest2 = 0.0;
  for (const Cell& cell : cells) {
    farthest2 = std::max(farthest2, ((p - cell.p_shape).cwiseAbs() + cell.half_m).squaredNorm());
  }
  return std::sqrt(farthest2);
}

/// Whether every edge is left as often as it is entered: an inside can be told from an outside.
bool is_closed(const Mesh& mesh) {
  std::map<std::array<double, 3>, int> places;  // vertices may be repeated
  std::vector<int> place_of;
  for (const Eigen::Vector3d& v : mesh.vertices_m) {
    const int next = static_cast<int>(places.size());
    place_of.push_back(places.try_emplace({v.x(), v.y(), v.z()}, next).first->second);
  }
  std::map<std::pair<int, int>, int> passes;
  for (const Eigen::Vector3i& triangle : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      const int from = place_of[idx(triangle[i])];
      const int to = place_of[idx(triangle[(i + 1) % 3])];
      if (from != to) passes[std::minmax(from, to)] += from < to ? 1 : -1;
    }
  }
  return std::ranges::all_of(passes, [](const auto& edge) { return edge.second == 0; });
}

/// Whether a closed mesh is wound inside out.
bool is_inside_out(const Mesh& mesh) {
  const auto at = [&](int vertex) { return mesh.vertices_m[idx(vertex)]; };
  double six_volumes = 0.0;  // measured from a vertex, lest a far origin blur them
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d from = at(mesh.triangles.front()[0]);
    six_volumes += (at(t[0]) - from).dot((at(t[1]) - from).cross(at(t[2]) - from));
  }
  return six_volumes < 0.0;
}

/// With an index, and a closed mesh outward-facing.
std::shared_ptr<const Mesh> searched(const std::shared_ptr<const Mesh>& mesh, bool is_solid) {
  const bool is_turned = is_solid && is_inside_out(*mesh);
  if (mesh->index != nullptr && !is_turned) return mesh;
  Mesh own = *mesh;
  if (is_turned) {
    for (Eigen::Vector3i& triangle : own.triangles) std::swap(triangle[1], triangle[2]);
  }
  return indexed_mesh(std::move(own));
}

struct Bounds {
  Eigen::AlignedBox3d operator()(const Box& box) const { return around(0.5 * box.size_m); }
  Eigen::AlignedBox3d operator()(const Sphere& sphere) const {
    return around(Eigen::Vector3d::Constant(sphere.radius_m));
  }
  Eigen::AlignedBox3d operator()(const Cylinder& cylinder) const {
    return around({cylinder.radius_m, cylinder.radius_m, 0.5 * cylinder.length_m});
  }
  Eigen::AlignedBox3d operator()(const Capsule& capsule) const {
    return around({capsule.radius_m, capsule.radius_m, 0.5 * capsule.length_m + capsule.radius_m});
  }
  Eigen::AlignedBox3d operator()(const HalfSpace&) const { return {}; }
  Eigen::AlignedBox3d operator()(const std::shared_ptr<const Mesh>& mesh) const {
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3i& triangle : mesh->triangles) {
      for (const int vertex : triangle) {
        box.extend(mesh->vertices_m[idx(vertex)]);
      }
    }
    return box;
  }

 private:
  static Eigen::AlignedBox3d around(const Eigen::Vector3d& half) { return {-half, half}; }
};

class SolidCover {
 public:
  SolidCover(Shape shape, double protrusion_m, std::size_t most)
      : shape_(std::move(shape)), protrusion_m_(protrusion_m), most_(most) {
    auto* mesh = std::get_if<std::shared_ptr<const Mesh>>(&shape_);
    if (mesh == nullptr) return;
    is_solid_ = is_closed(**mesh);
    *mesh = searched(*mesh, is_solid_);
  }

  std::optional<std::vector<Ball>> run() {
    const Eigen::AlignedBox3d bounds = std::visit(Bounds{}, shape_);
    if (bounds.isEmpty()) return balls_;
    const Cell whole{bounds.center(), 0.5 * bounds.sizes()};
    std::vector<Cell> cells;
    for (double fine_m = kFineShare * protrusion_m_;; fine_m *= kCoarser) {
      cells.clear();
      if (add(whole, fine_m, cells)) break;
    }
    if (!cells.empty() && !cover(cells)) return {};
    return std::move(balls_);
  }

 private:
  /// To the surface, negative inside.
  [[nodiscard]] double distance_m(const Eigen::Vector3d& p) const {
    const double distance = signed_distance_m(shape_, p);
    return is_solid_ ? distance : std::abs(distance);
  }

  /// Adds what of a cell holds some of the shape, in cells of their fineness; false where these
  /// are too many.
  bool add(const Cell& cell, double fine_m, std::vector<Cell>& cells) const {
    const double radius = cell.half_m.norm();
    const double distance = distance_m(cell.p_shape);
    if (distance > radius * kRadiusMargin) return true;
    if (radius <= std::max(fine_m, -kDepthShare * distance)) {
      cells.push_back(cell);
      return cells.size() <= kMostCells;
    }
    const auto [low, high] = halves(cell);
    return add(low, fine_m, cells) && add(high, fine_m, cells);
  }

  /// A ball that holds some cells, and by how much it stands out.
  struct Placed {
    Ball ball;
    double out_m;
  };
  [[nodiscard]] Placed ball_at(const Eigen::Vector3d& p, std::span<const Cell> cells) const {
    const double radius = farthest_m(cells, p) * kRadiusMargin;
    return {{p, radius}, radius + distance_m(p)};
  }

  /// Where a ball that holds these cells stands out by little enough, or by the least.
  [[nodiscard]] Placed best_ball(std::span<const Cell> cells) const {
    Eigen::AlignedBox3d bounds;
    for (const Cell& cell : cells) {
      bounds.extend(cell.p_shape - cell.half_m).extend(cell.p_shape + cell.half_m);
    }
    Placed best = ball_at(bounds.center(), cells);
    if (best.out_m > kHopeless * protrusion_m_) return best;
    double step = 0.5 * best.ball.radius_m;
    while (best.out_m > protrusion_m_ && step > kLeastStepShare * protrusion_m_) {
      const Eigen::Vector3d from = best.ball.p_shape;
      for (int i = 0; i < 27 && best.out_m > protrusion_m_; ++i) {
        const Eigen::Vector3d direction(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
        if (i == 13) continue;  // no direction
        const Placed other = ball_at(from + step * direction.normalized(), cells);
        if (other.out_m < best.out_m) best = other;
      }
      if (best.ball.p_shape == from) step *= 0.5;
    }
    return tightened(best, cells);
  }

  /// The same with the radius that it may have, if that is enough for what the cells have of the
  /// shape: at its surface they hold more than that.
  [[nodiscard]] Placed tightened(const Placed& placed, std::span<const Cell> cells) const {
    if (placed.out_m <= protrusion_m_) return placed;
    const double radius = placed.ball.radius_m - (placed.out_m - protrusion_m_);
    const bool is_enough = std::ranges::all_of(cells, [&](const Cell& cell) {
      return holds({placed.ball.p_shape, radius}, cell);
    });
    if (!is_enough) return placed;
    return {{placed.ball.p_shape, radius}, protrusion_m_};
  }

  [[nodiscard]] bool holds(const Ball& ball, const Cell& cell) const {
    if (farthest_m({&cell, 1}, ball.p_shape) * kRadiusMargin <= ball.radius_m) return true;
    const double radius = cell.half_m.norm();
    const double distance = distance_m(cell.p_shape);
    if (distance > radius * kRadiusMargin) return true;  // none of the shape
    const bool is_left_out =
        distance <= 0.0 && (cell.p_shape - ball.p_shape).norm() > ball.radius_m;
    if (is_left_out || radius < kLeastCellShare * protrusion_m_) return false;
    return std::ranges::all_of(halves(cell), [&](const Cell& half) { return holds(ball, half); });
  }

  /// Adds balls that hold all of the cells; false where these are too many.
  bool cover(std::span<Cell> cells) {
    const Placed placed = best_ball(cells);
    if (placed.out_m <= protrusion_m_) {
      balls_.push_back(placed.ball);
      return balls_.size() <= most_;
    }
    if (cells.size() == 1) {
      std::vector<Cell> finer;
      for (const Cell& half : halves(cells.front())) {
        if (distance_m(half.p_shape) <= half.half_m.norm() * kRadiusMargin) finer.push_back(half);
      }
      return finer.empty() || cover(finer);
    }
    Eigen::AlignedBox3d centres;
    for (const Cell& cell : cells) centres.extend(cell.p_shape);
    int longest = 0;
    centres.sizes().maxCoeff(&longest);
    const double middle = centres.center()[longest];
    const auto behind = std::ranges::partition(
        cells, [&](const Cell& cell) { return cell.p_shape[longest] <= middle; });
    const auto low = cells.size() - behind.size();
    return cover(cells.first(low)) && cover(cells.subspan(low));
  }

  Shape shape_;
  double protrusion_m_;
  std::size_t most_;
  bool is_solid_ = true;
  std::vector<Ball> balls_;
};

}  // namespace

std::optional<std::vector<Ball>> cover_solid(const Shape& shape, double protrusion_m,
                                             std::size_t most) {
  const auto* mesh = std::get_if<std::shared_ptr<const Mesh>>(&shape);
  if (mesh != nullptr && *mesh == nullptr) return std::vector<Ball>();
  return SolidCover(shape, protrusion_m, most).run();
}

}  // namespace sidestep
