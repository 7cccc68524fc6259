#include "full_transform.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>

#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

#include "line_keys.hpp"

namespace sidestep::edt {
namespace {

/// Writes what is not read again soon without reading the line of the cache before.
void write_past_cache(const TileOf<float>& tile, float* out) {
#if defined(__SSE2__)
  for (int i = 0; i < kTile; i += 4) _mm_stream_ps(out + i, _mm_load_ps(tile.values + i));
#else
  std::copy_n(tile.values, kTile, out);
#endif
}

/// Such writes become visible with what other threads see of this one from here on.
void finish_writing_past_cache() {
#if defined(__SSE2__)
  _mm_sfence();
#endif
}

}  // namespace

/// What one thread needs.
struct FullTransform::Workspace {
  Workspace(const Eigen::Vector3i& size, std::uint32_t cap)
      : along_y(size.y(), cap),
        along_z(size.z(), cap),
        // Slices a multiple of 4096 bytes apart would compete for the same few cache lines.
        slice_pitch(size.y() + 1),
        squared(std::make_unique_for_overwrite<Tile[]>(static_cast<std::size_t>(slice_pitch) *
                                                       static_cast<std::size_t>(size.z()))),
        column(static_cast<std::size_t>(size.z())),
        column_m(static_cast<std::size_t>(size.z())) {}

  LineKeys along_y, along_z;
  std::ptrdiff_t slice_pitch;
  std::unique_ptr<Tile[]> squared;  ///< After the pass along y, one tile a row.
  std::vector<int> slices;          ///< Those of it in which there is any obstacle.
  std::vector<Tile> column;
  std::vector<TileOf<float>> column_m;
};

bool FullTransform::fits(const Eigen::Vector3i& size_vox, std::uint32_t cap) {
  return size_vox.maxCoeff() < LineKeys::kFar / 2 &&
         LineKeys::fits(std::max(size_vox.y(), size_vox.z()), cap);
}

FullTransform::FullTransform(const Eigen::Vector3i& size_vox, std::vector<float> metres,
                             WorkerPool& workers)
    : size_(size_vox),
      metres_(std::move(metres)),
      workers_(workers),
      row_filled_(static_cast<std::size_t>(size_vox.y()) * static_cast<std::size_t>(size_vox.z())),
      distances_m_(size_vox) {
  const auto cap = static_cast<std::uint32_t>(metres_.size() - 1);
  for (int i = 0; i < workers.thread_count(); ++i) {
    spaces_.push_back(std::make_unique<Workspace>(size_, cap));
  }
}

FullTransform::~FullTransform() = default;

void FullTransform::update(const VoxelBits& obstacles) {
  const auto words = static_cast<std::size_t>(obstacles.words_per_row);
  for (std::size_t row = 0; row < row_filled_.size(); ++row) {
    const auto bits = obstacles.words.subspan(row * words, words);
    row_filled_[row] = std::ranges::any_of(bits, [](std::uint64_t word) { return word != 0; });
  }
  const int tiles = (size_.x() + kTile - 1) / kTile;
  std::atomic<int> next{0};
  workers_.run(static_cast<int>(spaces_.size()), [&](int thread) {
    Workspace& space = *spaces_[static_cast<std::size_t>(thread)];
    for (int tile = next++; tile < tiles; tile = next++) {
      transform_tile(obstacles, tile * kTile, space);
    }
    finish_writing_past_cache();
  });
}

void FullTransform::transform_tile(const VoxelBits& obstacles, int x, Workspace& space) {
  space.slices.clear();
  std::size_t row = 0;
  for (int z = 0; z < size_.z(); ++z) {
    LineKeys& line = space.along_y;
    line.clear();
    for (int y = 0; y < size_.y(); ++y, ++row) {
      if (row_filled_[row] == 0) continue;
      line.append_scanned(
          obstacles.words.data() + row * static_cast<std::size_t>(obstacles.words_per_row),
          obstacles.words_per_row, x, y);
    }
    if (line.is_empty()) continue;
    space.slices.push_back(z);
    line.solve(space.squared.get() + z * space.slice_pitch);
  }
  const auto cap = static_cast<std::uint32_t>(metres_.size() - 1);
  for (int y = 0; y < size_.y(); ++y) {
    LineKeys& line = space.along_z;
    line.clear();
    line.append_line(space.squared.get() + y, space.slice_pitch, space.slices);
    if (line.is_empty()) {
      for (Tile& tile : space.column) std::ranges::fill(tile.values, cap);
    } else {
      line.solve(space.column.data());
    }
    for (std::size_t i = 0; i < space.column.size(); ++i) {
      for (int lane = 0; lane < kTile; ++lane) {
        space.column_m[i].values[lane] = metres_[space.column[i].values[lane]];
      }
    }
    for (int z = 0; z < size_.z(); ++z) {
      write_past_cache(space.column_m[static_cast<std::size_t>(z)], distances_m_.row(y, z) + x);
    }
  }
}

}  // namespace sidestep::edt
