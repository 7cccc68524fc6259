#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>

#include <sidestep/core/error.hpp>

namespace sidestep::cuda {

/// Memory of a backend: the device's, or the host's own. Owns it.
template <class T>
class Memory {
 public:
  using Free = void (*)(void*);

  Memory() : data_(nullptr, [](void*) {}) {}
  Memory(T* data, std::size_t size, Free free) : data_(data, free), size_(size) {}

  [[nodiscard]] T* data() noexcept { return data_.get(); }
  [[nodiscard]] const T* data() const noexcept { return data_.get(); }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

 private:
  std::unique_ptr<T, Free> data_;
  std::size_t size_ = 0;
};

/// Memory anew; fails where the backend has no more, and then holds none.
template <class Backend, class T>
Result<void> renew(Backend& backend, Memory<T>& memory, std::size_t count) {
  memory = {};  // given back first: both may not fit
  memory = SIDESTEP_TRY(backend.template allocate<T>(count));
  return {};
}

/// Makes room for at least so much, at first for no more, then by doubling; what it held is lost
/// where it grows.
template <class Backend, class T>
Result<void> grow(Backend& backend, Memory<T>& memory, std::size_t count) {
  if (memory.size() >= count) return {};
  return renew(backend, memory, std::max(count, 2 * memory.size()));
}

/// The same of the host's memory that the device reads and writes directly.
template <class Backend, class T>
Result<void> grow_pinned(Backend& backend, Memory<T>& memory, std::size_t count) {
  if (memory.size() >= count) return {};
  memory = SIDESTEP_TRY(backend.template allocate_pinned<T>(std::max(count, 2 * memory.size())));
  return {};
}

}  // namespace sidestep::cuda
