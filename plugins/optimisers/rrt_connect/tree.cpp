#ifndef SIDESTEP_KERNELS
#include "tree.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#define SIDESTEP_KERNELS "tree.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep::rrt_connect {
namespace {

constexpr float kFar = 1e18f;

}  // namespace

std::size_t Tree::add(std::span<const double> point, std::size_t parent) {
  const std::size_t number = parents_.size();
  if (number % kFloatLanes == 0) {
    Block far;
    std::ranges::fill(far.values, kFar);
    blocks_.resize(blocks_.size() + dof_, far);
  }
  const std::size_t first = number / kFloatLanes * dof_;
  for (std::size_t joint = 0; joint < dof_; ++joint) {
    blocks_[first + joint].values[number % kFloatLanes] = static_cast<float>(point[joint]);
  }
  points_.insert(points_.end(), point.begin(), point.end());
  parents_.push_back(parent);
  return number;
}

Tree::Found Tree::nearest(std::span<const double> point) const noexcept {
  alignas(64) float squares[kFloatLanes], blocks[kFloatLanes];
  SIDESTEP_DISPATCH(find_nearest)
  (blocks_.front().values, blocks_.size() / dof_, dof_, point.data(), squares, blocks);
  const auto lane =
      static_cast<std::size_t>(std::min_element(squares, squares + kFloatLanes) - squares);
  return {static_cast<std::size_t>(blocks[lane]) * kFloatLanes + lane,
          std::sqrt(static_cast<double>(squares[lane]))};
}

}  // namespace sidestep::rrt_connect

#else

namespace {

/// The least squared distance in each lane, and in which block it is.
void find_nearest(const float* blocks, std::size_t count, std::size_t dof, const double* point,
                  float* squares, float* numbers) noexcept {
  FloatLanes least = FloatLanes{} + std::numeric_limits<float>::infinity(), number{};
  for (std::size_t block = 0; block < count; ++block) {
    FloatLanes sum{};
    for (std::size_t joint = 0; joint < dof; ++joint) {
      const FloatLanes off =
          lanes(blocks + (block * dof + joint) * kFloatLanes) - static_cast<float>(point[joint]);
      sum += off * off;
    }
    const auto is_less = sum < least;
    number = choose(is_less, FloatLanes{} + static_cast<float>(block), number);
    least = choose(is_less, sum, least);
  }
  lanes(squares) = least;
  lanes(numbers) = number;
}

}  // namespace

#endif
