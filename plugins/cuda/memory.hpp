#pragma once

#include <cstddef>
#include <memory>

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

}  // namespace sidestep::cuda
