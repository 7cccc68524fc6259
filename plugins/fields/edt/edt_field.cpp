#include "edt_field.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <sidestep/mapping/dense_field_publisher.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

#include "squared_transform.hpp"

namespace sidestep::edt {
namespace {

constexpr int kSide = kBlockSide_vox;

/// Bits of obstacles, or of their inverse, in the layout of a VoxelBits.
struct BitGrid {
  std::vector<std::uint64_t> words;
  int words_per_row = 0;

  [[nodiscard]] VoxelBits view() const { return {words, words_per_row}; }
};

/// The parts of the builder that depend on the width of a squared distance.
template <class Value>
class Transforms {
  using Start = typename SquaredTransform<Value>::Start;

 public:
  Transforms(const GridSpec& grid, std::uint32_t cap, bool is_signed, double max_distance_m,
             WorkerPool& workers)
      : obstacles_(grid.size_vox, cap, Start::kNoObstacles, workers),
        distance_m_(cap + std::size_t{1}) {
    if (is_signed) inverse_.emplace(grid.size_vox, cap, Start::kAllObstacles, workers);
    for (std::size_t d2 = 0; d2 < distance_m_.size(); ++d2) {
      distance_m_[d2] = static_cast<float>(grid.resolution_m * std::sqrt(static_cast<double>(d2)));
    }
    if (std::isfinite(max_distance_m)) distance_m_[cap] = static_cast<float>(max_distance_m);
  }

  /// Masks of tiles whose distances changed, by row.
  std::vector<std::uint64_t> update(const VoxelBits& obstacles, const VoxelBits& inverse,
                                    std::span<const std::uint8_t> row_changed) {
    const auto changed = obstacles_.update(obstacles, row_changed);
    std::vector<std::uint64_t> masks(changed.begin(), changed.end());
    if (inverse_) {
      const auto inside = inverse_->update(inverse, row_changed);
      std::ranges::transform(masks, inside, masks.begin(), std::bit_or<>{});
    }
    return masks;
  }

  /// Distances of `count` voxels of a row from x on.
  void row(int x, int y, int z, int count, float* out) const {
    const Value* d2 = obstacles_.row(y, z) + x;
    if (!obstacles_.holds_below_cap(x, y, z)) {
      std::fill_n(out, count, distance_m_.back());
    } else if (count == kSide) {  // a constant number of steps takes half the time
      for (int i = 0; i < kSide; ++i) out[i] = distance_m_[d2[i]];
    } else {
      for (int i = 0; i < count; ++i) out[i] = distance_m_[d2[i]];
    }
    if (!inverse_) return;
    const Value* inside = inverse_->row(y, z) + x;
    Value any = 0;
    for (int i = 0; i < count; ++i) any = static_cast<Value>(any | inside[i]);
    if (any == 0) return;
    for (int i = 0; i < count; ++i) out[i] -= distance_m_[inside[i]];
  }

 private:
  SquaredTransform<Value> obstacles_;
  std::optional<SquaredTransform<Value>> inverse_;
  std::vector<float> distance_m_;  // by squared distance in voxels
};

template <class Value>
class EdtBuilder final : public FieldBuilder {
 public:
  EdtBuilder(const Options& options, WorkerPool& workers) : options_(options), workers_(workers) {}

  Result<void> attach(Mapper& mapper) override {
    view_ = dynamic_cast<const OccupancyView*>(&mapper);
    if (view_ == nullptr) {
      return fail(ErrorCode::kUnsupported, "the mapper offers no OccupancyView", "field edt");
    }
    grid_ = view_->occupancy_grid();
    const double limit_m = options_.max_distance_m;
    const FieldInfo info{
        .grid = grid_,
        .is_signed = options_.is_signed,
        .max_distance_m = limit_m > 0.0 ? limit_m : std::numeric_limits<double>::infinity()};
    publisher_.emplace(info, *view_, workers_);
    transforms_.emplace(grid_, cap_vox2(options_, grid_), options_.is_signed, info.max_distance_m,
                        workers_);
    const Eigen::Vector3i& size = grid_.size_vox;
    const auto rows = static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(size.z());
    const int words = view_->occupied().words_per_row;
    for (BitGrid* bits : {&obstacles_, &inverse_}) {
      bits->words_per_row = words;
      bits->words.assign(rows * static_cast<std::size_t>(words), 0);
    }
    row_changed_.assign(rows, 1);
    return {};
  }

  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate& update) override {
    if (view_ == nullptr) {
      return fail(ErrorCode::kInvalidArgument, "update() before attach()", "field edt");
    }
    auto changed = publisher_->begin(update);
    if (!changed) return tl::make_unexpected(std::move(changed.error()));
    if (!std::exchange(first_, false)) mark_rows(update.changed_blocks);
    take_over_rows();
    const auto tiles = transforms_->update(obstacles_.view(), inverse_.view(), row_changed_);
    mark_blocks(tiles, *changed);
    return publisher_->publish(update, *changed,
                               [this](int x, int y, int z, int count, float* distances_m) {
                                 transforms_->row(x, y, z, count, distances_m);
                               });
  }

  /// The first squared distance, in voxels, at or beyond the limit.
  static std::uint32_t cap_vox2(const Options& options, const GridSpec& grid) {
    const double diagonal2 = grid.size_vox.cast<double>().squaredNorm();
    if (options.max_distance_m <= 0.0) return static_cast<std::uint32_t>(diagonal2);
    const double limit = options.max_distance_m / grid.resolution_m;
    const double cap = std::ceil(limit * limit * (1.0 - 1e-12));
    return static_cast<std::uint32_t>(std::clamp(cap, 1.0, diagonal2));
  }

 private:
  void mark_rows(const std::vector<std::int32_t>& changed_blocks) {
    std::ranges::fill(row_changed_, 0);
    const Eigen::Vector3i counts = block_counts(grid_);
    const Eigen::Vector3i& size = grid_.size_vox;
    for (const std::int32_t block : changed_blocks) {
      const int by = block / counts.x() % counts.y();
      const int bz = block / (counts.x() * counts.y());
      for (int z = bz * kSide; z < std::min((bz + 1) * kSide, size.z()); ++z) {
        for (int y = by * kSide; y < std::min((by + 1) * kSide, size.y()); ++y) {
          row_changed_[row_index(y, z)] = 1;
        }
      }
    }
  }

  /// Copies the changed rows of the map, under the policy for unknown voxels, and their inverse.
  void take_over_rows() {
    const VoxelBits occupied = view_->occupied();
    const VoxelBits known = view_->known();
    const bool unknown_blocks = options_.unknown == "occupied";
    const int words = obstacles_.words_per_row;
    const int size_x = grid_.size_vox.x();
    workers_.run_banded(static_cast<int>(row_changed_.size()), 256, [&](int begin, int end) {
      for (int row = begin; row < end; ++row) {
        if (row_changed_[static_cast<std::size_t>(row)] == 0) continue;
        for (int w = 0; w < words; ++w) {
          const auto at = static_cast<std::size_t>(row) * static_cast<std::size_t>(words) +
                          static_cast<std::size_t>(w);
          const int left = size_x - w * 64;
          const std::uint64_t valid =
              left >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << std::max(left, 0)) - 1;
          const std::uint64_t unknown = unknown_blocks ? ~known.words[at] : 0;
          const std::uint64_t bits = (occupied.words[at] | unknown) & valid;
          obstacles_.words[at] = bits;
          inverse_.words[at] = ~bits & valid;
        }
      }
    });
  }

  void mark_blocks(const std::vector<std::uint64_t>& tiles,
                   std::vector<std::uint8_t>& block_changed) const {
    const Eigen::Vector3i counts = block_counts(grid_);
    const Eigen::Vector3i& size = grid_.size_vox;
    for (int z = 0; z < size.z(); ++z) {
      for (int y = 0; y < size.y(); ++y) {
        const std::uint64_t mask = tiles[row_index(y, z)];
        if (mask == 0) continue;
        for (int bx = 0; bx < counts.x(); ++bx) {
          if ((mask >> (bx * kSide / kTile) & 1u) == 0) continue;
          block_changed[static_cast<std::size_t>(
              block_linear({bx, y / kSide, z / kSide}, counts))] = 1;
        }
      }
    }
  }

  [[nodiscard]] std::size_t row_index(int y, int z) const noexcept {
    return static_cast<std::size_t>(y) +
           static_cast<std::size_t>(grid_.size_vox.y()) * static_cast<std::size_t>(z);
  }

  Options options_;
  WorkerPool& workers_;
  const OccupancyView* view_ = nullptr;
  GridSpec grid_;
  bool first_ = true;
  std::optional<Transforms<Value>> transforms_;
  BitGrid obstacles_, inverse_;
  std::vector<std::uint8_t> row_changed_;
  std::optional<DenseFieldPublisher> publisher_;
};

/// Chooses the width of squared distances once the grid is known.
class ChoosingBuilder final : public FieldBuilder {
 public:
  ChoosingBuilder(Options options, WorkerPool& workers)
      : options_(std::move(options)), workers_(workers) {}

  Result<void> attach(Mapper& mapper) override {
    constexpr std::uint32_t kLargest16 = 32767;  // a sum of two must fit
    constexpr int kLargestRow_vox = 64 * kTile;  // a row's tiles are the bits of one word
    if (mapper.grid().size_vox.x() > kLargestRow_vox) {
      return fail(ErrorCode::kUnsupported,
                  "rows of more than " + std::to_string(kLargestRow_vox) + " voxels", "field edt");
    }
    if (EdtBuilder<std::uint16_t>::cap_vox2(options_, mapper.grid()) <= kLargest16) {
      builder_ = std::make_unique<EdtBuilder<std::uint16_t>>(options_, workers_);
    } else {
      builder_ = std::make_unique<EdtBuilder<std::uint32_t>>(options_, workers_);
    }
    return builder_->attach(mapper);
  }

  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate& update) override {
    if (!builder_) {
      return fail(ErrorCode::kInvalidArgument, "update() before attach()", "field edt");
    }
    return builder_->update(update);
  }

 private:
  Options options_;
  WorkerPool& workers_;
  std::unique_ptr<FieldBuilder> builder_;
};

}  // namespace

std::unique_ptr<FieldBuilder> make_edt_builder(const Options& options, WorkerPool& workers) {
  return std::make_unique<ChoosingBuilder>(options, workers);
}

}  // namespace sidestep::edt
