#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <memory>
#include <new>

#include <Eigen/Core>

namespace sidestep::edt {

/// Values are computed, and changes noted, in tiles of this many voxels along x.
inline constexpr int kTile = 16;

/// One value a voxel, x fastest; rows are padded to whole tiles. All zero at first, and a page of
/// memory costs nothing before it is written.
template <class Value>
class TiledGrid {
 public:
  explicit TiledGrid(const Eigen::Vector3i& size)
      : pitch_((size.x() + kTile - 1) / kTile * kTile),
        // Slices a multiple of 4096 bytes apart would compete for the same few cache lines.
        slice_pitch_(static_cast<std::ptrdiff_t>(size.y()) * pitch_ + 4 * kTile),
        values_(
            allocate(static_cast<std::size_t>(slice_pitch_) * static_cast<std::size_t>(size.z()))) {
  }

  [[nodiscard]] std::ptrdiff_t pitch() const noexcept { return pitch_; }
  [[nodiscard]] std::ptrdiff_t slice_pitch() const noexcept { return slice_pitch_; }
  [[nodiscard]] Value* row(int y, int z) noexcept { return values_.get() + offset(y, z); }
  [[nodiscard]] const Value* row(int y, int z) const noexcept {
    return values_.get() + offset(y, z);
  }

 private:
  struct Unmap {
    std::size_t bytes;
    void operator()(Value* memory) const noexcept { munmap(memory, bytes); }
  };
  using Memory = std::unique_ptr<Value[], Unmap>;

  static Memory allocate(std::size_t count) {
    const std::size_t bytes = count * sizeof(Value);
    void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) throw std::bad_alloc();
    madvise(memory, bytes, MADV_HUGEPAGE);  // fewer page faults; failure is harmless
    return Memory(static_cast<Value*>(memory), Unmap{bytes});
  }

  [[nodiscard]] std::ptrdiff_t offset(int y, int z) const noexcept {
    return y * pitch_ + z * slice_pitch_;
  }

  std::ptrdiff_t pitch_;
  std::ptrdiff_t slice_pitch_;
  Memory values_;
};

}  // namespace sidestep::edt
