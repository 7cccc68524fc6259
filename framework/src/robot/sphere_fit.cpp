#include <sidestep/robot/sphere_fit.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// Covers what rounding would leave bare.
constexpr double kRadiusMargin = 1.0 + 1e-9;

/// A sphere in a shape's frame.
struct Ball {
  Eigen::Vector3d p_shape = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
};

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

/// Balls that hold a bounded shape, each of which stands out from it by at most `protrusion_m`,
/// whatever its form; the same for the same input. Of a mesh that is not closed they hold the
/// triangles, from either side of which they stand out. Nothing where `most` balls are too few.
std::optional<std::vector<Ball>> cover_solid(const Shape& shape, double protrusion_m,
                                             std::size_t most) {
  const auto* mesh = std::get_if<std::shared_ptr<const Mesh>>(&shape);
  if (mesh != nullptr && *mesh == nullptr) return std::vector<Ball>();
  return SolidCover(shape, protrusion_m, most).run();
}

/// So few in a plain order are taken as they are; a cover that looks for its places may do with
/// fewer than more of them.
constexpr std::size_t kFewSpheres = 64;

using Balls = std::optional<std::vector<Ball>>;

/// A grid of equal spheres; its cells are halved where they stand out the most.
Balls cover_box(const Box& box, double protrusion_m) {
  const Eigen::Vector3d half = 0.5 * box.size_m;
  Eigen::Vector3i cells = Eigen::Vector3i::Ones();
  const auto cell_half = [&] { return half.cwiseQuotient(cells.cast<double>()).eval(); };
  while (cell_half().norm() - cell_half().minCoeff() > protrusion_m) {
    int longest = 0;
    cell_half().maxCoeff(&longest);
    cells[longest] += 1;
    if (cells.cast<double>().prod() > kMostFittedSpheres) return {};
  }
  std::vector<Ball> balls;
  const Eigen::Vector3d step = 2.0 * cell_half();
  for (int i = 0; i < cells.x(); ++i) {
    for (int j = 0; j < cells.y(); ++j) {
      for (int k = 0; k < cells.z(); ++k) {
        const Eigen::Vector3d middle = Eigen::Vector3d(i, j, k) + Eigen::Vector3d::Constant(0.5);
        balls.push_back({middle.cwiseProduct(step) - half, cell_half().norm() * kRadiusMargin});
      }
    }
  }
  return balls;
}

/// Spheres along the axis; nothing where the cylinder is too stout for that.
Balls cover_cylinder(const Cylinder& cylinder, double protrusion_m) {
  const double r = cylinder.radius_m;
  for (int n = 1; n <= kMostFittedSpheres; ++n) {
    const double slice_half = 0.5 * cylinder.length_m / n;
    const double radius = std::hypot(r, slice_half);
    if (radius - std::min(r, slice_half) > protrusion_m) continue;
    std::vector<Ball> balls;
    for (int i = 0; i < n; ++i) {
      const double z = -0.5 * cylinder.length_m + (2 * i + 1) * slice_half;
      balls.push_back({{0.0, 0.0, z}, radius * kRadiusMargin});
    }
    return balls;
  }
  return {};
}

Balls cover_capsule(const Capsule& capsule, double protrusion_m) {
  const double r = capsule.radius_m;
  // A sphere of radius R covers 2 sqrt(R^2 - r^2) of the axis; the outermost sit on the caps.
  const double radius = r + std::min(protrusion_m, 0.1 * r);
  const double pitch = 2.0 * std::sqrt(radius * radius - r * r);
  if (!(capsule.length_m <= pitch * (kMostFittedSpheres - 1))) return {};
  const int n = std::max(1, static_cast<int>(std::ceil(capsule.length_m / pitch)));
  const double step = capsule.length_m / n;
  std::vector<Ball> balls;
  for (int i = 0; i <= n; ++i) {
    balls.push_back({{0.0, 0.0, -0.5 * capsule.length_m + i * step},
                     std::hypot(r, 0.5 * step) * kRadiusMargin});
  }
  return balls;
}

/// Spheres in the order that the shape's form suggests.
struct PlainCover {
  double protrusion_m;
  Balls operator()(const Box& box) const { return cover_box(box, protrusion_m); }
  Balls operator()(const Sphere& sphere) const {
    return std::vector<Ball>{{Eigen::Vector3d::Zero(), sphere.radius_m}};
  }
  Balls operator()(const Cylinder& cylinder) const {
    return cover_cylinder(cylinder, protrusion_m);
  }
  Balls operator()(const Capsule& capsule) const { return cover_capsule(capsule, protrusion_m); }
  Balls operator()(const HalfSpace&) const { return std::vector<Ball>(); }
  Balls operator()(const std::shared_ptr<const Mesh>&) const { return {}; }
};

}  // namespace

Result<std::vector<CollisionSphere>> fit_spheres(const CollisionShape& shape, double protrusion_m) {
  if (!(protrusion_m > 0.0) || !std::isfinite(protrusion_m)) {
    return invalid("spheres stand out by a length above zero");
  }
  Balls balls = std::visit(PlainCover{protrusion_m}, shape.shape);
  if (!balls || balls->size() > kFewSpheres) {
    const std::size_t most = balls ? balls->size() - 1 : std::size_t{kMostFittedSpheres};
    if (auto fewer = cover_solid(shape.shape, protrusion_m, most)) balls = std::move(fewer);
  }
  if (!balls) {
    return fail(ErrorCode::kInvalidArgument,
                format("more than %d spheres are needed to cover a ", kMostFittedSpheres) +
                    std::string(shape_name(shape.shape)) +
                    format(" so that none stands out by more than %g m", protrusion_m),
                {}, "let them stand out farther, or list the spheres");
  }
  std::vector<CollisionSphere> spheres;
  for (const Ball& ball : *balls) {
    if (!(ball.radius_m > 0.0)) continue;
    spheres.push_back({shape.link, shape.T_link_shape * ball.p_shape, ball.radius_m});
  }
  return spheres;
}

}  // namespace sidestep
