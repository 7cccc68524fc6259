#include <sidestep/certificates/body.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <variant>

#include <Eigen/Geometry>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

constexpr double kOverlap_m = 1e-9;
constexpr int kSteps = 60;
/// What a direction may lose where it is rounded, of shapes of some metres.
constexpr double kRoundedDirection = 1e-3;

Eigen::Vector3d farthest_in(const Box& box, const Eigen::Vector3d& d) {
  const Eigen::Vector3d half = 0.5 * box.size_m;
  return {std::copysign(half.x(), d.x()), std::copysign(half.y(), d.y()),
          std::copysign(half.z(), d.z())};
}
Eigen::Vector3d farthest_in(const Sphere& ball, const Eigen::Vector3d& d) {
  return ball.radius_m * d.stableNormalized();
}
double cap(double length_m, const Eigen::Vector3d& d) {
  return d.z() < 0.0 ? -0.5 * length_m : 0.5 * length_m;
}
Eigen::Vector3d farthest_in(const Cylinder& cylinder, const Eigen::Vector3d& d) {
  const Eigen::Vector2d side = cylinder.radius_m * d.head<2>().stableNormalized();
  return {side.x(), side.y(), cap(cylinder.length_m, d)};
}
Eigen::Vector3d farthest_in(const Capsule& capsule, const Eigen::Vector3d& d) {
  return Eigen::Vector3d(0.0, 0.0, cap(capsule.length_m, d)) +
         capsule.radius_m * d.stableNormalized();
}
Eigen::Vector3d farthest_in(const HalfSpace&, const Eigen::Vector3d&) {
  return Eigen::Vector3d::Zero();
}
Eigen::Vector3d farthest_in(const std::shared_ptr<const Mesh>&, const Eigen::Vector3d&) {
  return Eigen::Vector3d::Zero();  // by its triangles
}

double reach_of(const Box& box) { return 0.5 * box.size_m.norm(); }
double reach_of(const Sphere& ball) { return ball.radius_m; }
double reach_of(const Cylinder& c) { return std::hypot(c.radius_m, 0.5 * c.length_m); }
double reach_of(const Capsule& c) { return c.radius_m + 0.5 * c.length_m; }
double reach_of(const HalfSpace&) { return std::numeric_limits<double>::infinity(); }
double reach_of(const std::shared_ptr<const Mesh>& mesh) {
  double most = 0.0;
  for (const Eigen::Vector3d& p : mesh->vertices_m) most = std::max(most, p.norm());
  return most;
}

/// A point of b - a, and the two that it comes from.
struct Difference {
  Eigen::Vector3d p, of_a, of_b;
};

Difference lowest(const PlacedBody& a, const PlacedBody& b, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d of_a = a.farthest(direction);
  const Eigen::Vector3d of_b = b.farthest(-direction);
  return {of_b - of_a, of_a, of_b};
}

struct Simplex {
  std::array<Difference, 4> points;
  std::array<double, 4> weights{};
  int size = 0;

  [[nodiscard]] Eigen::Vector3d mean(Eigen::Vector3d Difference::*of) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int i = 0; i < size; ++i) sum += weights[i] * (points[i].*of);
    return sum;
  }
};

/// Leaves of a simplex the part that has its point nearest to the origin inside, with that point's
/// weights. Its last point is in it, as it is nearer than the part without was. False where no part
/// comes nearer than `distance`.
bool keep_nearest_part(Simplex& simplex, double distance) {
  const int others = simplex.size - 1;
  const Eigen::Vector3d& last = simplex.points[others].p;
  std::array<Eigen::Vector3d, 3> edges;
  std::array<double, 3> back{};
  std::array<std::array<double, 3>, 3> dots{};
  for (int i = 0; i < others; ++i) {
    edges[i] = simplex.points[i].p - last;
    back[i] = -edges[i].dot(last);
    for (int j = 0; j <= i; ++j) dots[j][i] = edges[i].dot(edges[j]);
  }
  int best = -1;
  std::array<double, 3> best_weights{};
  double least = distance * distance;
  for (int subset = 0; subset < 1 << others; ++subset) {
    std::array<double, 3> w{};
    if (subset == 7) {
      const Eigen::Vector3d bc = edges[1].cross(edges[2]), ca = edges[2].cross(edges[0]);
      const Eigen::Vector3d ab = edges[0].cross(edges[1]);
      const double volume = -edges[0].dot(bc);
      w = {bc.dot(last) / volume, ca.dot(last) / volume, ab.dot(last) / volume};
    } else if (subset == 1 || subset == 2 || subset == 4) {
      const int i = subset / 2;
      w[i] = back[i] / dots[i][i];
    } else if (subset != 0) {
      const int i = subset == 6 ? 1 : 0, j = subset == 3 ? 1 : 2;
      const double ii = dots[i][i], jj = dots[j][j], ij = dots[i][j], det = ii * jj - ij * ij;
      w[i] = (jj * back[i] - ij * back[j]) / det;
      w[j] = (ii * back[j] - ij * back[i]) / det;
    }
    if (!(w[0] >= 0.0 && w[1] >= 0.0 && w[2] >= 0.0 && w[0] + w[1] + w[2] <= 1.0)) continue;
    Eigen::Vector3d p = last;
    for (int i = 0; i < others; ++i) p += w[i] * edges[i];
    if (!(p.squaredNorm() < least)) continue;
    least = p.squaredNorm();
    best = subset;
    best_weights = w;
  }
  if (best < 0) return false;
  simplex.size = 0;
  for (int i = 0; i <= others; ++i) {
    if (i < others && (best >> i & 1) == 0) continue;
    if (i != simplex.size) simplex.points[simplex.size] = simplex.points[i];
    simplex.weights[simplex.size++] =
        i < others ? best_weights[i] : 1.0 - best_weights[0] - best_weights[1] - best_weights[2];
  }
  return true;
}

double along_half(const Eigen::Vector3d& along, const Eigen::Vector3d& half) {
  return along.cwiseAbs().dot(half);
}

/// Whether each side of a triangle is one other's, the other way round. Corners are one that are so
/// on a grid of 1e-6 m; triangles of which two are, are none.
bool is_closed(const Mesh& mesh) {
  using Place = std::array<double, 3>;
  const auto place = [&](int vertex) {
    const Eigen::Vector3d p = (1e6 * mesh.vertices_m[idx(vertex)]).array().round();
    return Place{p.x(), p.y(), p.z()};
  };
  std::map<std::pair<Place, Place>, int> sides;
  for (const Eigen::Vector3i& triangle : mesh.triangles) {
    const std::array at{place(triangle[0]), place(triangle[1]), place(triangle[2])};
    if (at[0] == at[1] || at[1] == at[2] || at[2] == at[0]) continue;
    for (std::size_t k = 0; k < 3; ++k) ++sides[{at[k], at[(k + 1) % 3]}];
  }
  return std::ranges::all_of(sides, [&](const auto& side) {
    return side.second == 1 && sides.contains({side.first.second, side.first.first});
  });
}

}  // namespace

Body::Body(const Shape& shape) : shape_(shape) {
  if (const auto* const mesh = std::get_if<std::shared_ptr<const Mesh>>(&shape)) {
    mesh_ = mesh->get();
    triangles_ = mesh_->triangles;
    is_closed_mesh_ = is_closed(*mesh_);
    arrange(triangles_);
  } else {
    bounds_.resize(2);
  }
  reach_m_ = std::visit([](const auto& of) { return reach_of(of); }, shape);
}

Body::Body(const Swarm& swarm) : members_(swarm.members), kind_(swarm.kind) { arrange(members_); }

Body::Bounds Body::bounds_of(const Eigen::Vector3i& triangle) const {
  Eigen::AlignedBox3d box;
  for (const int vertex : triangle) box.extend(mesh_->vertices_m[idx(vertex)]);
  return {box.center(), 0.5 * box.sizes()};
}
Body::Bounds Body::bounds_of(const Swarm::Member& member) const {
  const double half_m = kind_ == Swarm::Kind::kCubes ? 0.5 * member.size_m : member.size_m;
  return {member.centre_m, Eigen::Vector3d::Constant(half_m)};
}

template <class Item>
void Body::arrange(std::vector<Item>& items) {
  count_ = items.size();
  std::size_t nodes = 2;
  while (nodes < 2 * count_) nodes *= 2;
  bounds_.resize(2 * nodes);
  if (count_ > 0) arrange(items, all());
}

template <class Item>
void Body::arrange(std::vector<Item>& items, const Share& share) {
  Eigen::AlignedBox3d box;
  for (std::size_t i = share.first; i < share.last; ++i) {
    const Bounds bounds = bounds_of(items[i]);
    box.extend(bounds.middle - bounds.half);
    box.extend(bounds.middle + bounds.half);
  }
  bounds_[share.node] = {box.center(), 0.5 * box.sizes()};
  if (share.is_single()) return;
  Eigen::Index longest = 0;
  box.sizes().maxCoeff(&longest);
  const auto at = [&](std::size_t i) { return items.begin() + static_cast<std::ptrdiff_t>(i); };
  const auto halves = share.halves();
  std::nth_element(at(share.first), at(halves[1].first), at(share.last),
                   [&](const Item& a, const Item& b) {
                     return bounds_of(a).middle[longest] < bounds_of(b).middle[longest];
                   });
  for (const Share& half : halves) arrange(items, half);
}

Eigen::Vector3d Body::centre(const Share& share) const { return bounds_[share.node].middle; }
double Body::extent_m(const Share& share) const {
  return share.is_single() ? 0.0 : bounds_[share.node].half.norm();
}
bool Body::is_half_space() const { return std::holds_alternative<HalfSpace>(shape_); }

Eigen::Vector3d Body::farthest_of(std::size_t item, const Eigen::Vector3d& along) const {
  if (mesh_ != nullptr) {
    const auto corner = [&](int vertex) { return mesh_->vertices_m[idx(vertex)]; };
    return corner(*std::ranges::max_element(triangles_[item], {},
                                            [&](int vertex) { return along.dot(corner(vertex)); }));
  }
  const Swarm::Member& member = members_[item];
  const Eigen::Vector3d from_centre =
      kind_ == Swarm::Kind::kCubes
          ? farthest_in(Box{Eigen::Vector3d::Constant(member.size_m)}, along)
          : farthest_in(Sphere{member.size_m}, along);
  return member.centre_m + from_centre;
}

Eigen::Vector3d Body::farthest(const Share& share, const Eigen::Vector3d& along) const {
  if (mesh_ == nullptr && members_.empty()) {
    return std::visit([&](const auto& of) -> Eigen::Vector3d { return farthest_in(of, along); },
                      shape_);
  }
  // The better half first; the other one where it may reach farther.
  std::array<Share, 128> open{share};
  std::size_t count = 1;
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  double most = -std::numeric_limits<double>::infinity();
  const auto bound = [&](const Share& of) {
    const Bounds& bounds = bounds_[of.node];
    return along.dot(bounds.middle) + along_half(along, bounds.half);
  };
  while (count > 0) {
    const Share here = open[--count];
    if (!(bound(here) > most)) continue;
    if (here.is_single()) {
      const Eigen::Vector3d p = farthest_of(here.first, along);
      if (along.dot(p) > most) most = along.dot(best = p);
      continue;
    }
    auto [worse, better] = here.halves();
    if (bound(worse) > bound(better)) std::swap(worse, better);
    open[count++] = worse;
    open[count++] = better;
  }
  return best;
}

bool Body::may_hold(const Eigen::Vector3d& p) const {
  return ((p - bounds_[1].middle).cwiseAbs().array() <= bounds_[1].half.array()).all();
}

std::vector<Eigen::Vector3d> Body::points() const {
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector3i& triangle : triangles_) {
    points.push_back(mesh_->vertices_m[idx(triangle[0])]);
  }
  for (const Swarm::Member& member : members_) points.push_back(member.centre_m);
  if (points.empty()) points.emplace_back(Eigen::Vector3d::Zero());
  return points;
}

Eigen::Vector3d PlacedBody::farthest(const Eigen::Vector3d& along) const {
  return T_world_body * body->farthest(share, T_world_body.linear().transpose() * along);
}

double gap_m(const PlacedBody& a, const PlacedBody& b, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d n = direction.normalized();
  if (b.body->is_half_space()) {
    const Eigen::Vector3d up = b.T_world_body.linear().col(2);
    return up.dot(a.farthest(-up) - b.T_world_body.translation());
  }
  return n.dot(b.farthest(-n)) - n.dot(a.farthest(n));
}

NearestPoints nearest_points(const PlacedBody& a, const PlacedBody& b, double near_m,
                             double wanted_m, const Eigen::Vector3d& along) {
  if (b.body->is_half_space()) {
    const Eigen::Vector3d up = b.T_world_body.linear().col(2);
    const Eigen::Vector3d p = a.farthest(-up);
    const double height_m = up.dot(p - b.T_world_body.translation());
    return {p, p - std::max(0.0, height_m) * up, height_m <= 0.0, -up, std::max(0.0, height_m)};
  }
  Simplex simplex;
  const Difference& first = simplex.points[0] = lowest(a, b, along);
  simplex.size = 1;
  simplex.weights[0] = 1.0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  double most_m = 0.0;
  if (const double apart_m = along.dot(first.p) / along.norm(); apart_m > 0.0) {
    most_m = apart_m;
    direction = along;
    if (apart_m > wanted_m) return {first.of_a, first.of_b, false, direction, most_m};
  }
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::Vector3d v = simplex.mean(&Difference::p);
    const double distance_m = v.norm();
    if (distance_m < kOverlap_m || simplex.size == 4) break;
    if (distance_m > near_m && distance_m < wanted_m) break;  // they cannot be shown apart
    const Difference next = lowest(a, b, v);
    if (v.dot(next.p) > most_m * distance_m) {
      most_m = v.dot(next.p) / distance_m;
      direction = v;
    }
    if (v.dot(next.p) > (wanted_m + kRoundedDirection) * distance_m) break;  // and here they are
    if (v.dot(v - next.p) <= 1e-12 * distance_m) break;
    simplex.points[simplex.size++] = next;
    if (!keep_nearest_part(simplex, distance_m)) {
      --simplex.size;
      break;
    }
  }
  const Eigen::Vector3d p_a = simplex.mean(&Difference::of_a);
  const Eigen::Vector3d p_b = simplex.mean(&Difference::of_b);
  return {p_a, p_b, (p_b - p_a).norm() < kOverlap_m, direction, most_m};
}

}  // namespace sidestep
