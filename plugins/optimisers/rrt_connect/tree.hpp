#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <sidestep/core/lanes.hpp>

namespace sidestep::rrt_connect {

/// A tree of points of a vector space. The nearest is found by looking at all of them in lanes, in
/// single precision: up to some ten thousand points that is sooner done than by a tree of boxes.
class Tree {
 public:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  struct Found {
    std::size_t number;
    double distance;
  };

  explicit Tree(std::size_t dof) : dof_(dof) {}

  /// Returns the number of the new point. `parent`: kNone for a root.
  std::size_t add(std::span<const double> point, std::size_t parent);
  [[nodiscard]] std::size_t size() const noexcept { return parents_.size(); }
  [[nodiscard]] std::span<const double> point(std::size_t number) const noexcept {
    return std::span(points_).subspan(number * dof_, dof_);
  }
  [[nodiscard]] std::size_t parent(std::size_t number) const noexcept { return parents_[number]; }
  /// The nearest point, up to the rounding of single precision. There must be one.
  [[nodiscard]] Found nearest(std::span<const double> point) const noexcept;

 private:
  struct alignas(64) Block {
    float values[kFloatLanes];
  };

  std::size_t dof_;
  std::vector<double> points_;
  std::vector<std::size_t> parents_;
  std::vector<Block>
      blocks_;  ///< kFloatLanes points each, joint by joint; far where there is none.
};

}  // namespace sidestep::rrt_connect
