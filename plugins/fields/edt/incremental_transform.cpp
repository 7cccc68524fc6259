#include "incremental_transform.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/core/lanes.hpp>

namespace sidestep::edt {
namespace {

/// Calls visit(begin, end) for each run of set bits among the first `size`, in order.
template <class Visit>
void for_each_run(const std::uint64_t* words, int size, Visit visit) {
  int begin = -1;  // of a run that reached the end of the word before
  for (int w = 0; w * 64 < size; ++w) {
    std::uint64_t word = words[w];
    int at = w * 64;
    int left = 64;
    while (left > 0) {
      const int step = std::min(left, begin < 0 ? std::countr_zero(word) : std::countr_one(word));
      word = step < 64 ? word >> step : 0;
      at += step;
      left -= step;
      if (left == 0) break;
      if (begin >= 0) visit(begin, at);
      begin = begin < 0 ? at : -1;
    }
  }
  if (begin >= 0) visit(begin, size);
}

/// Voxels [begin, end) between the obstacles `left` and `right` of a row: the square of the
/// distance to the nearer one, as far as the reach goes.
SIDESTEP_SIMD_CLONES
void fill_between(int left, int right, int begin, int end, std::uint16_t cap, int reach,
                  std::uint16_t* out) {
  for (int x = begin; x < end; ++x) {
    const int to_left = x - left;
    const int to_right = right - x;
    const int d = to_left < to_right ? to_left : to_right;
    out[x] = d <= reach ? static_cast<std::uint16_t>(d * d) : cap;
  }
}

/// Squared distance of every voxel of a row to the nearest obstacle in it; `cap` where there is
/// none within `reach`, the largest offset whose square is below the cap. Bit i of `words` is voxel
/// i of `size`.
void scan_row(const std::uint64_t* words, int size, std::uint16_t cap, int reach,
              std::uint16_t* out) {
  int before = -1 - reach;  // the obstacle before; at first one beyond the reach
  for_each_run(words, size, [&](int begin, int end) {
    fill_between(before, begin, std::max(before + 1, 0), begin, cap, reach, out);
    std::fill(out + begin, out + end, std::uint16_t{0});
    before = end - 1;
  });
  fill_between(before, size + reach, std::max(before + 1, 0), size, cap, reach, out);
}

}  // namespace

IncrementalTransform::Workspace::Workspace(const Eigen::Vector3i& size, std::uint16_t cap)
    : row(static_cast<std::size_t>((size.x() + kTile - 1) / kTile * kTile)),
      envelope(std::max(size.y(), size.z()), cap),
      out(static_cast<std::size_t>(std::max(size.y(), size.z()))),
      tile_in_previous(out.size() * kTile),
      tile_out_previous(out.size() * kTile) {}

/// One of the workspaces, for as long as this lives.
class IncrementalTransform::BorrowedWorkspace {
 public:
  explicit BorrowedWorkspace(IncrementalTransform& owner) : owner_(owner) {
    {
      const std::scoped_lock lock(owner_.spaces_mutex_);
      if (!owner_.spaces_.empty()) {
        space_ = std::move(owner_.spaces_.back());
        owner_.spaces_.pop_back();
      }
    }
    if (space_ == nullptr) space_ = std::make_unique<Workspace>(owner_.size_, owner_.cap_);
  }
  ~BorrowedWorkspace() {
    const std::scoped_lock lock(owner_.spaces_mutex_);
    owner_.spaces_.push_back(std::move(space_));
  }
  BorrowedWorkspace(const BorrowedWorkspace&) = delete;
  BorrowedWorkspace& operator=(const BorrowedWorkspace&) = delete;

  Workspace& operator*() const noexcept { return *space_; }

 private:
  IncrementalTransform& owner_;
  std::unique_ptr<Workspace> space_;
};

IncrementalTransform::IncrementalTransform(const Eigen::Vector3i& size_vox, std::uint32_t cap,
                                           Start start, WorkerPool& workers)
    : size_(size_vox),
      cap_(static_cast<std::uint16_t>(cap)),
      reach_(static_cast<int>(std::ceil(std::sqrt(static_cast<double>(cap)))) - 1),
      tiles_((size_vox.x() + kTile - 1) / kTile),
      workers_(workers),
      along_x_(size_vox),
      along_y_(size_vox),
      along_z_(size_vox),
      changes_(static_cast<std::size_t>(size_vox.y()) * static_cast<std::size_t>(size_vox.z())),
      line_changed_(static_cast<std::size_t>(size_vox.y()), 0),
      along_y_previous_(static_cast<std::size_t>(size_vox.z())),
      changed_(changed_index(size_vox, size_vox.y(), 0), 0),
      start_tile_(kTile, start == Start::kAllObstacles ? std::uint16_t{0} : cap_) {
  // Zeros, too, are written: the first update must not wait for memory.
  for (Grid* values : {&along_x_, &along_y_, &along_z_}) {
    workers_.run(size_.z(), [&](int z) {
      for (int y = 0; y < size_.y(); ++y) {
        std::fill_n(values->row(y, z), size_.x(), start_tile_.front());
      }
    });
  }
}

void IncrementalTransform::pass_row(const VoxelBits& obstacles, int y, int z, Workspace& space) {
  constexpr std::size_t kTileBytes = kTile * sizeof(std::uint16_t);
  scan_row(
      obstacles.words.data() + row_index(y, z) * static_cast<std::size_t>(obstacles.words_per_row),
      size_.x(), cap_, reach_, space.row.data());
  std::uint64_t tiles = 0;
  for (int tile = 0; tile < tiles_; ++tile) {
    const std::uint16_t* fresh = space.row.data() + tile * kTile;
    std::uint16_t* values = along_x_.row(y, z) + tile * kTile;
    if (std::memcmp(fresh, values, kTileBytes) == 0) continue;
    if (!is_first_) space.in_previous.insert(space.in_previous.end(), values, values + kTile);
    std::memcpy(values, fresh, kTileBytes);
    tiles |= std::uint64_t{1} << tile;
  }
  if (tiles != 0) space.in.push_back({y, {tiles, nullptr}});
}

void IncrementalTransform::pass_line(const Line& line, bool wants_previous,
                                     Workspace& space) const {
  std::uint64_t tiles = 0;
  for (const ChangedRow& in : space.in) tiles |= in.change.tiles;
  std::fill_n(space.out.begin(), line.length, std::uint64_t{0});
  space.out_previous.clear();
  for (; tiles != 0; tiles &= tiles - 1) {
    const int tile = std::countr_zero(tiles);
    const std::uint64_t bit = std::uint64_t{1} << tile;
    space.rows.clear();
    for (const auto& [row, change] : space.in) {
      if ((change.tiles & bit) == 0) continue;
      space.rows.push_back(row);
      if (is_first_) continue;
      const int before = std::popcount(change.tiles & (bit - 1));
      std::copy_n(change.previous + before * kTile, kTile,
                  space.tile_in_previous.data() + row * kTile);
    }
    const TileLine column{
        .length = line.length,
        .stride = line.stride,
        .in = line.in + tile * kTile,
        .in_previous = is_first_ ? start_tile_.data() : space.tile_in_previous.data(),
        .in_previous_stride = is_first_ ? 0 : kTile,
        .out = line.out + tile * kTile,
        .out_previous = space.tile_out_previous.data()};
    space.out_previous_begin[idx(tile)] = space.out_previous.size();
    for (const int row : space.envelope.update(column, space.rows)) {
      space.out[idx(row)] |= bit;
      if (!wants_previous) continue;
      const std::uint16_t* previous = space.tile_out_previous.data() + row * kTile;
      space.out_previous.insert(space.out_previous.end(), previous, previous + kTile);
    }
  }
}

void IncrementalTransform::hand_on(int z, Workspace& space) {
  auto& tiles_previous = along_y_previous_[idx(z)];
  tiles_previous.resize(space.out_previous.size());
  std::uint16_t* previous = tiles_previous.data();
  for (int y = 0; y < size_.y(); ++y) {
    std::uint64_t tiles = space.out[idx(y)];
    if (tiles == 0) continue;
    changes_[along_z_index(y, z)] = {tiles, previous};
    std::atomic_ref(line_changed_[idx(y)]).store(1, std::memory_order_relaxed);
    if (is_first_) continue;
    // pass_line() went tile by tile; the next pass wants those of a row together.
    for (; tiles != 0; tiles &= tiles - 1, previous += kTile) {
      std::size_t& from = space.out_previous_begin[idx(std::countr_zero(tiles))];
      std::copy_n(space.out_previous.data() + from, kTile, previous);
      from += kTile;
    }
  }
}

void IncrementalTransform::update_slice(const VoxelBits& obstacles,
                                        std::span<const std::uint8_t> row_changed, int z,
                                        Workspace& space) {
  space.in.clear();
  space.in_previous.clear();
  for (int y = 0; y < size_.y(); ++y) {
    if (row_changed[idx(y)] != 0) pass_row(obstacles, y, z, space);
  }
  const std::uint16_t* previous = space.in_previous.data();
  for (auto& [row, change] : space.in) {
    change.previous = previous;
    if (!is_first_) previous += std::popcount(change.tiles) * kTile;
  }
  pass_line({size_.y(), along_x_.row(0, z), along_y_.row(0, z), along_x_.pitch()}, !is_first_,
            space);
  hand_on(z, space);
}

void IncrementalTransform::update_line(int y, Workspace& space) {
  const std::span<std::uint64_t> changed(changed_.data() + changed_index(size_, y, 0),
                                         changed_index(size_, 1, 0));
  space.in.clear();
  for (int z = 0; z < size_.z(); ++z) {
    Change& change = changes_[along_z_index(y, z)];
    if (change.tiles != 0) space.in.push_back({z, std::exchange(change, {})});
  }
  pass_line({size_.z(), along_y_.row(y, 0), along_z_.row(y, 0), along_y_.slice_pitch()}, false,
            space);
  for (int z = 0; z < size_.z(); ++z) {
    changed[idx(z / kTile)] |= space.out[idx(z)];
  }
}

template <class Condition, class Task>
void IncrementalTransform::for_each(int count, const Condition& condition, const Task& task) {
  busy_.clear();
  for (int i = 0; i < count; ++i) {
    if (condition(i)) busy_.push_back(i);
  }
  workers_.run_banded(static_cast<int>(busy_.size()), 1, [&](int begin, int end) {
    const BorrowedWorkspace space(*this);
    for (int i = begin; i < end; ++i) task(busy_[idx(i)], *space);
  });
}

std::span<const std::uint64_t> IncrementalTransform::update(
    const VoxelBits& obstacles, std::span<const std::uint8_t> row_changed) {
  const auto ny = static_cast<std::size_t>(size_.y());
  const auto rows_of = [&](int z) { return row_changed.subspan(row_index(0, z), ny); };
  for_each(
      size_.z(), [&](int z) { return std::memchr(rows_of(z).data(), 1, ny) != nullptr; },
      [&](int z, Workspace& space) { update_slice(obstacles, rows_of(z), z, space); });
  std::ranges::fill(changed_, std::uint64_t{0});
  for_each(
      size_.y(), [&](int y) { return line_changed_[idx(y)] != 0; },
      [&](int y, Workspace& space) { update_line(y, space); });
  std::ranges::fill(line_changed_, std::uint8_t{0});
  is_first_ = false;
  return changed_;
}

}  // namespace sidestep::edt
