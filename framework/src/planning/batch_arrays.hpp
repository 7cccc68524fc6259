#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>

#include <sidestep/core/scratch.hpp>

namespace sidestep::detail {

/// `count` objects of T in a scratch arena, default-initialised (uninitialised for numbers and
/// Eigen vectors), valid until the scope ends.
template <class T>
[[nodiscard]] std::span<T> scratch_array(Scratch::Scope& scope, std::size_t count) {
  static_assert(std::is_trivially_destructible_v<T> && alignof(T) <= 64);
  const std::size_t doubles = (count * sizeof(T) + sizeof(double) - 1) / sizeof(double);
  T* first = reinterpret_cast<T*>(scope.doubles(doubles).data());
  std::uninitialized_default_construct_n(first, count);
  return {first, count};
}

}  // namespace sidestep::detail
