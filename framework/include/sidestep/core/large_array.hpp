#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>

#include <sidestep/core/export.hpp>

namespace sidestep {

namespace detail {
/// Gives pages back to the system.
struct SIDESTEP_EXPORT Unmap {
  std::size_t bytes = 0;
  void operator()(void* memory) const noexcept;
};
[[nodiscard]] SIDESTEP_EXPORT void* map_zeroed(std::size_t bytes);
}  // namespace detail

/// An array of many megabytes, in huge pages where the system has them: fewer page faults, and
/// faster at random.
template <class Value>
using LargeArray = std::unique_ptr<Value[], detail::Unmap>;

/// All bytes are zero at first; a page costs nothing before it is written. Throws std::bad_alloc.
/// [any]
template <class Value>
[[nodiscard]] LargeArray<Value> make_large_array(std::size_t count) {
  static_assert(std::is_trivially_copyable_v<Value>);
  const std::size_t bytes = count * sizeof(Value);
  return {static_cast<Value*>(detail::map_zeroed(bytes)), detail::Unmap{bytes}};
}

}  // namespace sidestep
