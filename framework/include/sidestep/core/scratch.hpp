#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

namespace sidestep {

/// A caller-owned arena for the temporaries of kernels, one per thread. After the first
/// calls it has reached its size and never allocates again.
///
///     Scratch::Scope scope(scratch);
///     std::span<double> centres = scope.doubles(3 * n);   // valid until scope ends
class Scratch {
 public:
  class Scope {
   public:
    explicit Scope(Scratch& scratch) : scratch_(scratch), mark_(scratch.used_) {}
    ~Scope() { scratch_.used_ = mark_; }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

    /// `count` doubles, uninitialised, aligned to 64 bytes.
    [[nodiscard]] std::span<double> doubles(std::size_t count) { return scratch_.take(count); }

    /// `count` objects, default-initialised (uninitialised for numbers and Eigen vectors).
    template <class T>
    [[nodiscard]] std::span<T> array(std::size_t count) {
      static_assert(std::is_trivially_destructible_v<T> && alignof(T) <= 64);
      const std::size_t doubles = (count * sizeof(T) + sizeof(double) - 1) / sizeof(double);
      T* first = reinterpret_cast<T*>(scratch_.take(doubles).data());
      std::uninitialized_default_construct_n(first, count);
      return {first, count};
    }

   private:
    Scratch& scratch_;
    std::size_t mark_;
  };

 private:
  static constexpr std::size_t kChunkDoubles = std::size_t{1} << 16;
  static constexpr std::size_t kLineDoubles = 8;  // 64 bytes
  struct alignas(64) Line {
    double values[kLineDoubles];
  };
  struct Chunk {
    std::unique_ptr<Line[]> lines;
    std::size_t begin = 0;  // position of the first double of this chunk in the arena
    std::size_t size = 0;
  };

  std::span<double> take(std::size_t count) {
    const std::size_t rounded = (count + kLineDoubles - 1) / kLineDoubles * kLineDoubles;
    for (const Chunk& chunk : chunks_) {
      const std::size_t at = std::max(used_, chunk.begin);
      if (at + rounded <= chunk.begin + chunk.size) {
        used_ = at + rounded;
        return {&chunk.lines[0].values[0] + (at - chunk.begin), count};
      }
    }
    Chunk chunk;
    chunk.begin = chunks_.empty() ? 0 : chunks_.back().begin + chunks_.back().size;
    chunk.size = std::max(rounded, kChunkDoubles);
    chunk.lines = std::make_unique_for_overwrite<Line[]>(chunk.size / kLineDoubles);
    used_ = chunk.begin + rounded;
    chunks_.push_back(std::move(chunk));
    return {&chunks_.back().lines[0].values[0], count};
  }

  std::vector<Chunk> chunks_;
  std::size_t used_ = 0;
};

}  // namespace sidestep
