#ifndef SIDESTEP_KERNELS
#include "flat_points.hpp"

#include <limits>

#define SIDESTEP_KERNELS "flat_points.cpp"
#include <sidestep/core/each_target.hpp>
#include <sidestep/core/index.hpp>

namespace sidestep::joint_paths {

void FlatPoints::clear() noexcept {
  size_ = 0;
  blocks_.clear();
}

void FlatPoints::add(const double* point) {
  if (size_ % kLanes == 0) blocks_.resize(blocks_.size() + dof_ * kLanes, kInfinity);
  for (std::size_t joint = 0; joint < dof_; ++joint) at(size_, joint) = point[joint];
  ++size_;
}

void FlatPoints::remove(std::size_t number) {
  --size_;
  for (std::size_t joint = 0; joint < dof_; ++joint) {
    at(number, joint) = at(size_, joint);
    at(size_, joint) = kInfinity;
  }
  if (size_ % kLanes == 0) blocks_.resize(size_ * dof_);
}

std::size_t FlatPoints::nearest(const double* point) const noexcept {
  alignas(64) double squares[kLanes], blocks[kLanes];
  SIDESTEP_DISPATCH(find_nearest)
  (blocks_.data(), (size_ + kLanes - 1) / kLanes, dof_, point, squares, blocks);
  const std::size_t lane =
      static_cast<std::size_t>(std::min_element(squares, squares + kLanes) - squares);
  return static_cast<std::size_t>(blocks[lane]) * kLanes + lane;
}

}  // namespace sidestep::joint_paths

#else

namespace {

/// The least squared distance in each lane, and in which block it is.
void find_nearest(const double* blocks, std::size_t count, std::size_t dof, const double* point,
                  double* squares, double* numbers) noexcept {
  Lanes least = Lanes{} + std::numeric_limits<double>::infinity(), number{};
  for (std::size_t block = 0; block < count; ++block) {
    Lanes sum{};
    for (std::size_t joint = 0; joint < dof; ++joint) {
      const Lanes off = lanes(blocks + (block * dof + joint) * kLanes) - point[joint];
      sum += off * off;
    }
    const auto is_less = sum < least;
    number = choose(is_less, Lanes{} + static_cast<double>(block), number);
    least = choose(is_less, sum, least);
  }
  lanes(squares) = least;
  lanes(numbers) = number;
}

}  // namespace

#endif
