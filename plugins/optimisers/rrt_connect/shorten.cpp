#include "shorten.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "random.hpp"

namespace sidestep::rrt_connect {
namespace {

constexpr double kShareOfAll = 0.25;   ///< Of short cuts: those of all joints.
constexpr double kWorthwhile = 0.999;  ///< Of a stretch's length.

class Shortener {
 public:
  Shortener(std::vector<double>& path, const Shortening& how, joint_paths::Checker& checker,
            std::uint64_t seed, const Deadline& deadline)
      : path_(path),
        how_(how),
        dof_(how.weights.size()),
        checker_(checker),
        random_(seed),
        deadline_(deadline) {}

  /// From each vertex on, straight to the last that can be reached so.
  void leave_out() {
    for (std::size_t from = 0; from + 2 < size(); ++from) {
      for (std::size_t to = size() - 1; to > from + 1; --to) {
        const auto way = way_between(vertices(from, 1), vertices(to, 1));
        if (!is_better(way, vertices(from, to - from + 1)) || !is_clear(way)) continue;
        path_.insert(erase(from, to + 1), way.begin(), way.end());
        break;
      }
    }
  }

  /// Tries to straighten the path between two random places on different edges.
  void cut() {
    const double whole = length(path_);
    double from = random_.unit() * whole, to = random_.unit() * whole;
    if (to < from) std::swap(from, to);
    const Place a = place_at(from), b = place_at(to);
    if (a.edge == b.edge) return;
    const bool of_all = random_.unit() < kShareOfAll;
    const auto joint =
        of_all ? dof_ : static_cast<std::size_t>(random_.unit() * static_cast<double>(dof_));
    if (of_all || !how_.steering.is_free(joint)) {
      cut_all(a, b);
    } else {
      cut_joint(a, b, joint);
    }
  }

 private:
  /// A configuration on the edge from the vertex of this number to the next.
  struct Place {
    std::size_t edge;
    std::vector<double> q;
  };

  [[nodiscard]] std::size_t size() const noexcept { return path_.size() / dof_; }
  [[nodiscard]] std::span<const double> vertices(std::size_t first, std::size_t count) const {
    return std::span<const double>(path_).subspan(first * dof_, count * dof_);
  }
  [[nodiscard]] double length(std::span<const double> path) const {
    return path_length(path, how_.weights);
  }
  [[nodiscard]] bool is_clear(std::span<const double> way) {
    for (std::size_t i = dof_; i < way.size(); i += dof_) {
      if (deadline_.expired() || !checker_.is_clear(way.subspan(i - dof_, dof_),
                                                    way.subspan(i, dof_), how_.resolution_m)) {
        return false;
      }
    }
    return true;
  }
  [[nodiscard]] std::vector<double> way_between(std::span<const double> from,
                                                std::span<const double> to) const {
    std::vector<double> way(from.begin(), from.end());
    how_.steering.append(from, to, way);
    return way;
  }
  /// A straight line always is.
  [[nodiscard]] bool is_better(std::span<const double> way, std::span<const double> before) const {
    return how_.steering.is_straight() || length(way) < kWorthwhile * length(before);
  }
  std::vector<double>::iterator erase(std::size_t from, std::size_t to) {
    return path_.erase(path_.begin() + static_cast<std::ptrdiff_t>(from * dof_),
                       path_.begin() + static_cast<std::ptrdiff_t>(to * dof_));
  }

  [[nodiscard]] Place place_at(double along) const {
    std::size_t edge = 0;
    double edge_length = length(vertices(0, 2));
    while (along > edge_length && edge + 2 < size()) {
      along -= edge_length;
      edge_length = length(vertices(++edge, 2));
    }
    const double part = edge_length > 0.0 ? std::min(1.0, along / edge_length) : 0.0;
    const std::span<const double> from = vertices(edge, 1), to = vertices(edge + 1, 1);
    Place place{edge, std::vector<double>(dof_)};
    for (std::size_t j = 0; j < dof_; ++j) place.q[j] = from[j] + part * (to[j] - from[j]);
    return place;
  }

  /// A place, the vertices between the two, and the other place.
  [[nodiscard]] std::vector<double> stretch(const Place& a, const Place& b) const {
    std::vector<double> stretch(a.q);
    const auto between = vertices(a.edge + 1, b.edge - a.edge);
    stretch.insert(stretch.end(), between.begin(), between.end());
    stretch.insert(stretch.end(), b.q.begin(), b.q.end());
    return stretch;
  }

  void cut_all(const Place& a, const Place& b) {
    const std::vector<double> way = way_between(a.q, b.q);
    if (is_better(way, stretch(a, b)) && is_clear(way)) replace(a, b, way);
  }

  /// One joint goes evenly from one place to the other, all others as before.
  void cut_joint(const Place& a, const Place& b, std::size_t joint) {
    const std::vector<double> before = stretch(a, b);
    const double whole = length(before);
    if (whole == 0.0) return;
    std::vector<double> after = before;
    for (std::size_t i = dof_; i < after.size(); i += dof_) {
      const double part = length(std::span(before).first(i + dof_)) / whole;
      after[i + joint] = a.q[joint] + part * (b.q[joint] - a.q[joint]);
    }
    if (length(after) > kWorthwhile * whole) return;
    if (is_clear(after)) replace(a, b, after);
  }

  void replace(const Place& a, const Place& b, const std::vector<double>& stretch) {
    path_.insert(erase(a.edge + 1, b.edge + 1), stretch.begin(), stretch.end());
  }

  std::vector<double>& path_;
  const Shortening& how_;
  std::size_t dof_;
  joint_paths::Checker& checker_;
  Random random_;
  const Deadline& deadline_;
};

}  // namespace

double path_length(std::span<const double> path, std::span<const double> weights) {
  double sum = 0.0;
  for (std::size_t i = weights.size(); i < path.size(); i += weights.size()) {
    double squares = 0.0;
    for (std::size_t j = 0; j < weights.size(); ++j) {
      const double way = (path[i + j] - path[i + j - weights.size()]) * weights[j];
      squares += way * way;
    }
    sum += std::sqrt(squares);
  }
  return sum;
}

void shorten(std::vector<double>& path, const Shortening& how, joint_paths::Checker& checker,
             std::uint64_t seed, const Deadline& deadline) {
  Shortener shortener(path, how, checker, seed, deadline);
  shortener.leave_out();
  for (int i = 0; i < how.tries && !deadline.expired(); ++i) shortener.cut();
  shortener.leave_out();
}

}  // namespace sidestep::rrt_connect
