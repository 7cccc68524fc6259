#include <sidestep/core/large_array.hpp>

#include <sys/mman.h>

#include <new>

namespace sidestep::detail {

void Unmap::operator()(void* memory) const noexcept { munmap(memory, bytes); }

void* map_zeroed(std::size_t bytes) {
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  madvise(memory, bytes, MADV_HUGEPAGE);  // failure is harmless
  return memory;
}

}  // namespace sidestep::detail
