#include "edt_field.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include <sidestep/mapping/dense_field_publisher.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "full_transform.hpp"
#include "incremental_transform.hpp"

namespace sidestep::edt {
namespace {

constexpr int kSide = kBlockSide_vox;
static_assert(kSide == kTile, "a tile is one row of a block");

/// Bits of obstacles, or of their inverse, in the layout of a VoxelBits.
struct BitGrid {
  std::vector<std::uint64_t> words;
  int words_per_row = 0;

  [[nodiscard]] VoxelBits view() const { return {words, words_per_row}; }
};

/// What the transforms of the two kinds, of obstacles and of their inverse, make of each other.
class Distances {
 public:
  virtual ~Distances() = default;

  /// Brings the distances up to date with rows of obstacles that may have changed. Returns which
  /// tiles' distances may have, as IncrementalTransform::update() does.
  virtual std::span<const std::uint64_t> update(const BitGrid& obstacles, const BitGrid& inverse,
                                                std::span<const std::uint8_t> row_changed) = 0;

  /// Distances, in metres, of `count` voxels, at most a tile, of a row from x on. [any]
  virtual void row(int x, int y, int z, int count, float* distances_m) const = 0;
};

/// Cut off so near that squared distances fit 16 bits: kept up to date incrementally.
class NearDistances final : public Distances {
 public:
  NearDistances(const GridSpec& grid, std::uint32_t cap, bool is_signed, double max_distance_m,
                WorkerPool& workers)
      : outside_(grid.size_vox, cap, IncrementalTransform::Start::kNoObstacles, workers),
        table_m_(distance_table(grid.resolution_m, cap, max_distance_m)) {
    if (is_signed) {
      inside_.emplace(grid.size_vox, cap, IncrementalTransform::Start::kAllObstacles, workers);
    }
  }

  std::span<const std::uint64_t> update(const BitGrid& obstacles, const BitGrid& inverse,
                                        std::span<const std::uint8_t> row_changed) override {
    const auto outside = outside_.update(obstacles.view(), row_changed);
    if (!inside_) return outside;
    const auto inside = inside_->update(inverse.view(), row_changed);
    changed_.resize(outside.size());
    std::ranges::transform(outside, inside, changed_.begin(), std::bit_or<>{});
    return changed_;
  }

  void row(int x, int y, int z, int count, float* distances_m) const override {
    const std::uint16_t* outside = outside_.row(y, z) + x;
    if (count == kTile) {  // a constant number of steps takes half the time
      for (int i = 0; i < kTile; ++i) distances_m[i] = table_m_[outside[i]];
    } else {
      for (int i = 0; i < count; ++i) distances_m[i] = table_m_[outside[i]];
    }
    if (!inside_) return;
    const std::uint16_t* inside = inside_->row(y, z) + x;
    std::uint16_t any = 0;
    for (int i = 0; i < count; ++i) any = static_cast<std::uint16_t>(any | inside[i]);
    if (any == 0) return;
    for (int i = 0; i < count; ++i) distances_m[i] -= table_m_[inside[i]];
  }

 private:
  IncrementalTransform outside_;
  std::optional<IncrementalTransform> inside_;
  std::vector<std::uint64_t> changed_;
  std::vector<float> table_m_;
};

/// Cut off far away or nowhere: recomputed whenever an obstacle changed.
class FarDistances final : public Distances {
 public:
  FarDistances(const GridSpec& grid, std::uint32_t cap, bool is_signed, double max_distance_m,
               WorkerPool& workers)
      : outside_(grid.size_vox, distance_table(grid.resolution_m, cap, max_distance_m), workers),
        changed_(IncrementalTransform::changed_index(grid.size_vox, grid.size_vox.y(), 0)) {
    if (!is_signed) return;
    inside_.emplace(grid.size_vox, distance_table(grid.resolution_m, cap, max_distance_m), workers);
  }

  std::span<const std::uint64_t> update(const BitGrid& obstacles, const BitGrid& inverse,
                                        std::span<const std::uint8_t> row_changed) override {
    const bool any = !has_values_ || std::ranges::find(row_changed, 1) != row_changed.end();
    std::ranges::fill(changed_, any ? ~std::uint64_t{0} : 0);
    if (!any) return changed_;
    has_values_ = true;
    outside_.update(obstacles.view());
    if (inside_) inside_->update(inverse.view());
    return changed_;
  }

  void row(int x, int y, int z, int count, float* distances_m) const override {
    std::copy_n(outside_.row(y, z) + x, count, distances_m);
    if (!inside_) return;
    const float* inside_m = inside_->row(y, z) + x;
    for (int i = 0; i < count; ++i) distances_m[i] -= inside_m[i];
  }

 private:
  FullTransform outside_;
  std::optional<FullTransform> inside_;
  bool has_values_ = false;
  std::vector<std::uint64_t> changed_;
};

class EdtBuilder final : public FieldBuilder {
 public:
  EdtBuilder(Options options, WorkerPool& workers)
      : options_(std::move(options)), workers_(workers) {}

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
        .max_distance_m = limit_m > 0.0 ? limit_m : std::numeric_limits<double>::infinity(),
        .lipschitz = 1.0};
    SIDESTEP_TRY(make_distances(info));
    publisher_.emplace(info, *view_, workers_);
    const Eigen::Vector3i& size = grid_.size_vox;
    const auto rows = static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(size.z());
    const int words = view_->occupied().words_per_row;
    for (BitGrid* bits : {&obstacles_, &inverse_}) {
      bits->words_per_row = words;
      bits->words.assign(rows * static_cast<std::size_t>(words), 0);
    }
    row_changed_.assign(rows, 0);
    first_ = true;
    return {};
  }

  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate& update) override {
    if (!publisher_) {
      return fail(ErrorCode::kInvalidArgument, "update() before attach()", "field edt");
    }
    auto changed = SIDESTEP_TRY(publisher_->begin(update));
    const bool is_first = std::exchange(first_, false);
    // Where voxels have only become known, distances stay as they are.
    if (!is_first) std::ranges::fill(changed, std::uint8_t{0});
    copy_changed_rows(update.changed_blocks, is_first);
    mark_blocks(distances_->update(obstacles_, inverse_, row_changed_), changed);
    return publisher_->publish(update, changed,
                               [this](int x, int y, int z, int count, float* distances_m) {
                                 distances_->row(x, y, z, count, distances_m);
                               });
  }

 private:
  Result<void> make_distances(const FieldInfo& info) {
    constexpr int kLongestRow_vox = 64 * kTile;  // a row's tiles are the bits of one word
    const std::uint32_t cap = cap_vox2(options_.max_distance_m, grid_);
    if (grid_.size_vox.x() > kLongestRow_vox || !FullTransform::fits(grid_.size_vox, cap)) {
      return fail(
          ErrorCode::kUnsupported, "the grid is too large", "field edt",
          "at most " + std::to_string(kLongestRow_vox) + " voxels along x; set max_distance_m");
    }
    if (cap <= IncrementalTransform::kLargestCap) {
      distances_ = std::make_unique<NearDistances>(grid_, cap, options_.is_signed,
                                                   info.max_distance_m, workers_);
    } else {
      distances_ = std::make_unique<FarDistances>(grid_, cap, options_.is_signed,
                                                  info.max_distance_m, workers_);
    }
    return {};
  }

  /// Copies the rows of the map in changed blocks, or all of them, under the policy for unknown
  /// voxels, and their inverse; marks those that came out different.
  void copy_changed_rows(std::span<const std::int32_t> changed_blocks, bool is_first) {
    const Eigen::Vector3i counts = block_counts(grid_);
    const Eigen::Vector3i& size = grid_.size_vox;
    std::vector<int> block_rows;  // by y, then z
    for (const std::int32_t block : changed_blocks) {
      const int row = block / counts.x();
      if (block_rows.empty() || block_rows.back() != row) block_rows.push_back(row);
    }
    if (is_first) {
      block_rows.resize(static_cast<std::size_t>(counts.y() * counts.z()));
      std::iota(block_rows.begin(), block_rows.end(), 0);
    }
    std::ranges::sort(block_rows);
    block_rows.erase(std::ranges::unique(block_rows).begin(), block_rows.end());
    std::ranges::fill(row_changed_, std::uint8_t{0});
    workers_.run_banded(static_cast<int>(block_rows.size()), 1, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        const int b = block_rows[static_cast<std::size_t>(i)];
        const int first_y = b % counts.y() * kSide;
        const int first_z = b / counts.y() * kSide;
        for (int z = first_z; z < std::min(first_z + kSide, size.z()); ++z) {
          for (int y = first_y; y < std::min(first_y + kSide, size.y()); ++y) {
            const std::size_t row = row_index(y, z);
            if (copy_row(row)) row_changed_[row] = 1;
          }
        }
      }
    });
  }

  /// Whether that changed the row.
  bool copy_row(std::size_t row) {
    const VoxelBits occupied = view_->occupied();
    const VoxelBits known = view_->known();
    const bool unknown_blocks = options_.unknown == "occupied";
    const auto words = static_cast<std::size_t>(obstacles_.words_per_row);
    std::uint64_t differs = 0;
    for (std::size_t w = 0; w < words; ++w) {
      const std::size_t at = row * words + w;
      const int left = grid_.size_vox.x() - static_cast<int>(w) * 64;
      const std::uint64_t valid =
          left >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << std::max(left, 0)) - 1;
      const std::uint64_t unknown = unknown_blocks ? ~known.words[at] : 0;
      const std::uint64_t bits = (occupied.words[at] | unknown) & valid;
      differs |= obstacles_.words[at] ^ bits;
      obstacles_.words[at] = bits;
      inverse_.words[at] = ~bits & valid;
    }
    return differs != 0;
  }

  void mark_blocks(std::span<const std::uint64_t> tiles,
                   std::vector<std::uint8_t>& block_changed) const {
    const Eigen::Vector3i counts = block_counts(grid_);
    for (int y = 0; y < grid_.size_vox.y(); ++y) {
      for (int bz = 0; bz < counts.z(); ++bz) {
        std::uint64_t mask =
            tiles[IncrementalTransform::changed_index(grid_.size_vox, y, bz * kSide)];
        for (; mask != 0; mask &= mask - 1) {
          const int bx = std::countr_zero(mask);
          if (bx >= counts.x()) break;
          block_changed[static_cast<std::size_t>(block_linear({bx, y / kSide, bz}, counts))] = 1;
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
  std::unique_ptr<Distances> distances_;
  BitGrid obstacles_, inverse_;
  std::vector<std::uint8_t> row_changed_;
  std::optional<DenseFieldPublisher> publisher_;
};

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext& context) {
  return make_edt_builder(options, context.workers);
}

}  // namespace

std::uint32_t cap_vox2(double max_distance_m, const GridSpec& grid) {
  const double diagonal2 = grid.size_vox.cast<double>().squaredNorm();
  if (max_distance_m <= 0.0) return static_cast<std::uint32_t>(diagonal2);
  const double limit = max_distance_m / grid.resolution_m;
  const double cap = std::ceil(limit * limit * (1.0 - 1e-12));
  return static_cast<std::uint32_t>(std::clamp(cap, 1.0, diagonal2));
}

std::vector<float> distance_table(double resolution_m, std::uint32_t cap, double max_distance_m) {
  std::vector<float> table_m(cap + std::size_t{1});
  for (std::size_t d2 = 0; d2 < table_m.size(); ++d2) {
    table_m[d2] = static_cast<float>(resolution_m * std::sqrt(static_cast<double>(d2)));
  }
  if (std::isfinite(max_distance_m)) table_m[cap] = static_cast<float>(max_distance_m);
  return table_m;
}

std::unique_ptr<FieldBuilder> make_edt_builder(const Options& options, WorkerPool& workers) {
  return std::make_unique<EdtBuilder>(options, workers);
}

}  // namespace sidestep::edt

SIDESTEP_PLUGIN(sidestep::FieldBuilder, sidestep::edt::Options, sidestep::edt::create, "edt",
                "0.1.0", "Exact Euclidean distance transform of dense occupancy",
                sidestep::OccupancyView)
