#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "flat_points.hpp"

namespace sidestep::rrt_connect {

/// A tree of points of a vector space.
class Tree {
 public:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  struct Found {
    std::size_t number;
    double distance;
  };

  explicit Tree(std::size_t dof) : dof_(dof), lanes_(dof) {}

  /// Returns the number of the new point. `parent`: kNone for a root.
  std::size_t add(std::span<const double> point, std::size_t parent) {
    lanes_.add(point.data());
    points_.insert(points_.end(), point.begin(), point.end());
    parents_.push_back(parent);
    return parents_.size() - 1;
  }
  [[nodiscard]] std::size_t size() const noexcept { return parents_.size(); }
  [[nodiscard]] std::span<const double> point(std::size_t number) const noexcept {
    return std::span(points_).subspan(number * dof_, dof_);
  }
  [[nodiscard]] std::size_t parent(std::size_t number) const noexcept { return parents_[number]; }
  /// There must be one.
  [[nodiscard]] Found nearest(std::span<const double> to) const noexcept {
    const std::size_t number = lanes_.nearest(to.data());
    double squares = 0.0;
    for (std::size_t j = 0; j < dof_; ++j) {
      const double off = point(number)[j] - to[j];
      squares += off * off;
    }
    return {number, std::sqrt(squares)};
  }

 private:
  std::size_t dof_;
  std::vector<double> points_;
  std::vector<std::size_t> parents_;
  joint_paths::FlatPoints lanes_;
};

}  // namespace sidestep::rrt_connect
