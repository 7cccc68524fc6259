#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>

namespace sidestep::incremental {

/// An array for random access over many megabytes, in huge pages where the system has them. Starts
/// with all bytes zero.
template <class T>
class LargeArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  explicit LargeArray(std::size_t size) : memory_(map(size), Unmap{size * sizeof(T)}) {}

  [[nodiscard]] T& operator[](int i) noexcept { return memory_.get()[i]; }
  [[nodiscard]] const T& operator[](int i) const noexcept { return memory_.get()[i]; }

 private:
  struct Unmap {
    std::size_t bytes = 0;
    void operator()(T* memory) const noexcept { munmap(memory, bytes); }
  };

  static T* map(std::size_t size) {
    void* memory =
        mmap(nullptr, size * sizeof(T), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) throw std::bad_alloc();
    madvise(memory, size * sizeof(T), MADV_HUGEPAGE);  // failure is harmless
    return static_cast<T*>(memory);
  }

  std::unique_ptr<T[], Unmap> memory_;
};

}  // namespace sidestep::incremental
