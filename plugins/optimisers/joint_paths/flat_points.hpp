#pragma once

#include <cstddef>
#include <vector>

#include <sidestep/core/lanes.hpp>

namespace sidestep::joint_paths {

/// Points of a vector space, looked through in lanes: up to some ten thousand of them, the nearest
/// is found sooner so than by a tree that asks for distances one by one.
class FlatPoints {
 public:
  explicit FlatPoints(std::size_t dof) : dof_(dof) {}

  void clear() noexcept;
  void add(const double* point);
  /// Puts the last in its place.
  void remove(std::size_t number);
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// The number of the nearest, in the order of add(); of several, the first of its lane. There
  /// must be one.
  [[nodiscard]] std::size_t nearest(const double* point) const noexcept;

 private:
  [[nodiscard]] double& at(std::size_t number, std::size_t joint) noexcept {
    return blocks_[(number / kLanes * dof_ + joint) * kLanes + number % kLanes];
  }

  std::size_t dof_;
  std::size_t size_ = 0;
  std::vector<double>
      blocks_;  ///< kLanes points each, joint by joint; infinite where there is none.
};

}  // namespace sidestep::joint_paths
