#include "cluster_fit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <queue>

#include <Eigen/Eigenvalues>

#include <sidestep/core/index.hpp>
#include <sidestep/robot/sphere_fit.hpp>

namespace sidestep {
namespace {

/// Boxes in the depth: half diagonal at most this share of the depth.
constexpr double kDepthShare = 0.3;
/// Of boxes, halved to find the radius of one sphere.
constexpr int kMostHalvings = 4000;
constexpr double kRadiusTolerance_m = 2e-5;

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

constexpr std::size_t kMostClusterCells = 40'000;
constexpr std::size_t kClusterDirections = 64;
/// What rounding may add: half a grain along each axis, and one of the radius.
constexpr double kFitRounding_m = 3e-4;
constexpr int kRounds = 6;
constexpr int kMostDropsRefused = 4;

double total_excess_m3(const auto& clusters) {
  double sum = 0.0;
  for (const auto& cluster : clusters) sum += cluster.excess_m3;
  return sum;
}

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

ClusterFit::ClusterFit(const RigidBody& body, int link, const Held& held, const Settings& settings)
    : body_(body),
      link_(link),
      protrusion_m_(std::max(settings.protrusion_m - kFitRounding_m, kGrain_m)),
      directions_(even_on_sphere(kClusterDirections)) {
  Held all = held;
  for (const BodyPart& part : body.parts) {
    const auto* const sphere = std::get_if<Sphere>(&part.shape);
    if (sphere == nullptr || part.link != link) continue;
    balls_.push_back({link, part.T_body_shape.translation(), sphere->radius_m});
    all.spheres.push_back(balls_.back());
  }
  cells_ = link_cells(body, link, all, settings.fine_m, kMostClusterCells);
  // The boxes of a sphere stand out of it; it is held by itself.
  std::erase_if(cells_, [&](const Cell& cell) {
    return std::holds_alternative<Sphere>(body.parts[idx(cell.part)].shape);
  });
  if (cells_.empty()) return;
  Cluster whole;
  whole.cells = cells_;
  const auto [low, high] = ends(whole);
  whole.p_body = 0.5 * (low + high);
  clusters_.push_back(std::move(whole));
  iterate(clusters_, 1);
}

Eigen::Vector3d ClusterFit::centre_m(const Cell& cell) const {
  return body_.parts[idx(cell.part)].T_body_shape * cell.p_shape;
}

ClusterFit::Cluster ClusterFit::sphere_at(const Eigen::Vector3d& p_body,
                                          std::span<const Cell> cells) const {
  Cluster cluster;
  cluster.p_body = p_body;
  int part = -1;
  Eigen::Vector3d p_shape = Eigen::Vector3d::Zero();
  for (const Cell& cell : cells) {
    if (cell.part != std::exchange(part, cell.part)) {
      p_shape = body_.parts[idx(part)].T_shape_body * p_body;
    }
    cluster.radius_m = std::max(cluster.radius_m, farthest_m(cell, p_shape));
  }
  const double r = cluster.radius_m;
  // Exact for a centre within one shape: to where that ends soonest.
  cluster.protrusion_m = r + signed_distance_m(body_, p_body);
  if (cluster.protrusion_m > protrusion_m_)
    return cluster;  // What it has outside is no matter then.
  for (const Eigen::Vector3d& direction : directions_) {
    cluster.excess_m3 += std::max(0.0, signed_distance_m(body_, p_body + r * direction));
  }
  cluster.excess_m3 *= 4.0 * std::numbers::pi * r * r / kClusterDirections;
  return cluster;
}

bool ClusterFit::is_better(const Cluster& a, const Cluster& b) const noexcept {
  const double a_beyond = std::max(a.protrusion_m, protrusion_m_);
  const double b_beyond = std::max(b.protrusion_m, protrusion_m_);
  if (a_beyond != b_beyond) return a_beyond < b_beyond - 1e-9;
  return a.excess_m3 < (1.0 - 1e-6) * b.excess_m3;
}

/// Each cell to the sphere that stands out the least when it holds the cell.
void ClusterFit::assign(Clusters& clusters) const {
  std::vector<double> depth(clusters.size());
  for (std::size_t i = 0; i < clusters.size(); ++i) {
    clusters[i].cells.clear();
    depth[i] = -signed_distance_m(body_, clusters[i].p_body);
  }
  std::vector<Eigen::Vector3d> p_shape(clusters.size());
  int part = -1;
  for (const Cell& cell : cells_) {
    if (cell.part != std::exchange(part, cell.part)) {
      for (std::size_t i = 0; i < clusters.size(); ++i) {
        p_shape[i] = body_.parts[idx(part)].T_shape_body * clusters[i].p_body;
      }
    }
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < clusters.size(); ++i) {
      const double protrusion = farthest_m(cell, p_shape[i]) - depth[i];
      if (protrusion < least) {
        least = protrusion;
        best = i;
      }
    }
    clusters[best].cells.push_back(cell);
  }
  std::erase_if(clusters, [](const Cluster& cluster) { return cluster.cells.empty(); });
}

/// Pattern search for the best place of a sphere that holds the cells. Only cells that may come to
/// be the farthest one are looked at.
void ClusterFit::improve(Cluster& cluster) const {
  std::vector<Cell> all = std::move(cluster.cells);
  cluster = sphere_at(cluster.p_body, all);
  std::vector<Cell> far;
  for (double step = 0.3 * cluster.radius_m; step > 0.5 * kGrain_m; step *= 0.5) {
    far.clear();
    for (const Cell& cell : all) {
      const Eigen::Vector3d p_shape = body_.parts[idx(cell.part)].T_shape_body * cluster.p_body;
      // Two moves, each of which brings one cell as much nearer as another one farther.
      if (farthest_m(cell, p_shape) >= cluster.radius_m - 4.0 * step) far.push_back(cell);
    }
    for (int moves = 0; moves < 2 && move_by(step, far, cluster); ++moves) {
    }
  }
  cluster = sphere_at(cluster.p_body, all);
  cluster.cells = std::move(all);
}

/// To the best of the six places a step aside; false where none is better.
bool ClusterFit::move_by(double step, std::span<const Cell> cells, Cluster& cluster) const {
  const Eigen::Vector3d from = cluster.p_body;
  bool has_moved = false;
  for (int axis = 0; axis < 6; ++axis) {
    Cluster aside =
        sphere_at(from + (axis < 3 ? step : -step) * Eigen::Vector3d::Unit(axis % 3), cells);
    if (!is_better(aside, cluster)) continue;
    cluster = std::move(aside);
    has_moved = true;
  }
  return has_moved;
}

void ClusterFit::iterate(Clusters& clusters, int rounds) const {
  double before_m = std::numeric_limits<double>::infinity();
  double before_m3 = before_m;
  for (int round = 0; round < rounds; ++round) {
    assign(clusters);
    double worst_m = protrusion_m_;
    for (Cluster& cluster : clusters) {
      improve(cluster);
      worst_m = std::max(worst_m, cluster.protrusion_m);
    }
    const double excess_m3 = total_excess_m3(clusters);
    if (worst_m > before_m - kGrain_m && excess_m3 > 0.99 * before_m3) return;
    before_m = worst_m;
    before_m3 = excess_m3;
  }
}

/// Where boxes at curved surfaces make a sphere too large.
void ClusterFit::tighten(Clusters& clusters) const {
  for (Cluster& cluster : clusters) {
    if (cluster.protrusion_m <= protrusion_m_) continue;
    const double radius = radius_to_hold_m(body_, cluster.cells, cluster.p_body);
    cluster.protrusion_m += radius - cluster.radius_m;
    cluster.radius_m = radius;
  }
}

/// Two places along the axis in which a cluster is longest.
std::pair<Eigen::Vector3d, Eigen::Vector3d> ClusterFit::ends(const Cluster& cluster) const {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double total = 0.0;
  for (const Cell& cell : cluster.cells) {
    mean += cell.half_m.prod() * centre_m(cell);
    total += cell.half_m.prod();
  }
  mean /= total;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Cell& cell : cluster.cells) {
    const Eigen::Vector3d off = centre_m(cell) - mean;
    spread += cell.half_m.prod() / total * off * off.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
  const double deviation = std::sqrt(std::max(axes.eigenvalues()[2], kGrain_m * kGrain_m));
  const Eigen::Vector3d half = deviation * axes.eigenvectors().col(2);
  return {mean - half, mean + half};
}

void ClusterFit::divide(Clusters& clusters, std::size_t index) const {
  const auto [low, high] = ends(clusters[index]);
  clusters[index].p_body = low;
  clusters.emplace_back().p_body = high;
}

bool ClusterFit::is_close_enough(const Clusters& clusters) const {
  return std::ranges::all_of(
      clusters, [&](const Cluster& cluster) { return cluster.protrusion_m <= protrusion_m_; });
}

void ClusterFit::reach_protrusion(int most_spheres, const std::stop_token& stop) {
  for (;;) {
    iterate(clusters_, kRounds);
    tighten(clusters_);
    if (is_close_enough(clusters_) || spheres() >= most_spheres || stop.stop_requested()) break;
    // A third of those that stand out too far at once, the worst ones.
    std::ranges::stable_sort(clusters_, std::ranges::greater{}, &Cluster::protrusion_m);
    const auto too_far = std::ranges::count_if(
        clusters_, [&](const Cluster& one) { return one.protrusion_m > protrusion_m_; });
    const auto count = std::min<std::ptrdiff_t>((too_far + 2) / 3, most_spheres - spheres());
    for (std::ptrdiff_t i = 0; i < count; ++i) divide(clusters_, static_cast<std::size_t>(i));
  }
  if (is_close_enough(clusters_)) drop_superfluous(stop);
}

/// Division leaves more than are needed: those with the fewest cells first.
void ClusterFit::drop_superfluous(const std::stop_token& stop) {
  int refused = 0;
  std::ranges::stable_sort(clusters_, {}, [](const Cluster& one) { return one.cells.size(); });
  for (std::size_t i = 0; i < clusters_.size() && clusters_.size() > 1;) {
    if (refused == kMostDropsRefused || stop.stop_requested()) return;
    Clusters without = clusters_;
    without.erase(without.begin() + static_cast<std::ptrdiff_t>(i));
    iterate(without, kRounds);
    tighten(without);
    if (is_close_enough(without)) {
      clusters_ = std::move(without);
    } else {
      ++refused;
      ++i;
    }
  }
}

std::vector<CollisionSphere> ClusterFit::result() const {
  const Transform T_body_link = body_.find(link_)->T_body_link;
  const Transform T_link_body = T_body_link.inverse();
  std::vector<CollisionSphere> spheres;
  for (const BodySphere& ball : balls_) {
    spheres.push_back({link_, T_link_body * ball.p_body, ball.radius_m});
  }
  for (const Cluster& cluster : clusters_) {
    const Eigen::Vector3d centre = to_grain(T_link_body * cluster.p_body);
    const double radius = radius_to_hold_m(body_, cluster.cells, T_body_link * centre);
    spheres.push_back({link_, centre, up_to_grain(radius)});
  }
  return spheres;
}

}  // namespace sidestep
