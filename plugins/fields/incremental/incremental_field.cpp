#include "incremental_field.hpp"

#include <algorithm>
#include <bit>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/mapping/dense_field_publisher.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "closest_obstacles.hpp"

namespace sidestep::incremental {
namespace {

/// Which voxels became obstacles and which ceased to be, found by comparing the blocks that a map
/// says it changed with a copy of the bits that they had before. [mapping]
class OccupancyChanges {
 public:
  /// Voxels never observed are obstacles if `unknown_is_obstacle`; before the first find() none
  /// has been observed. `view` must outlive this.
  OccupancyChanges(const OccupancyView& view, bool unknown_is_obstacle)
      : view_(view),
        unknown_is_obstacle_(unknown_is_obstacle),
        obstacles_(view.occupied().words.size(), unknown_is_obstacle ? ~std::uint64_t{0} : 0) {}

  /// Fills both queues from the flagged blocks, one flag a block in block_linear order. Fills
  /// them in that order, so that what follows does not depend on who changed the map how.
  void find(std::span<const std::uint8_t> block_changed) {
    inserted_.clear();
    removed_.clear();
    const Eigen::Vector3i counts = block_counts(view_.occupancy_grid());
    for (int b = 0; b < static_cast<int>(block_changed.size()); ++b) {
      if (block_changed[idx(b)] == 0) continue;
      compare_block({b % counts.x(), b / counts.x() % counts.y(), b / (counts.x() * counts.y())});
    }
  }

  /// What the newest find() found.
  [[nodiscard]] const std::vector<Eigen::Vector3i>& inserted() const noexcept { return inserted_; }
  [[nodiscard]] const std::vector<Eigen::Vector3i>& removed() const noexcept { return removed_; }

 private:
  void compare_block(const Eigen::Vector3i& block) {
    const Eigen::Vector3i& size = view_.occupancy_grid().size_vox;
    const VoxelBits occupied = view_.occupied();
    const VoxelBits known = view_.known();
    const Eigen::Vector3i low = block * kBlockSide_vox;
    const Eigen::Vector3i high = (low.array() + kBlockSide_vox).min(size.array());
    const auto shift = static_cast<unsigned>(low.x() % 64);
    const std::uint64_t in_row = (std::uint64_t{1} << (high.x() - low.x())) - 1;
    for (int z = low.z(); z < high.z(); ++z) {
      for (int y = low.y(); y < high.y(); ++y) {
        const auto row = static_cast<std::size_t>(y) +
                         static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(z);
        const std::size_t at = row * static_cast<std::size_t>(occupied.words_per_row) +
                               static_cast<std::size_t>(low.x() / 64);
        std::uint64_t now = occupied.words[at];
        if (unknown_is_obstacle_) now |= ~known.words[at];
        const std::uint64_t flipped = (now ^ obstacles_[at]) & in_row << shift;
        obstacles_[at] ^= flipped;
        for (std::uint64_t left = flipped >> shift; left != 0; left &= left - 1) {
          const int x = low.x() + std::countr_zero(left);
          const bool is_obstacle = (now >> (x % 64) & 1u) != 0;
          (is_obstacle ? inserted_ : removed_).emplace_back(x, y, z);
        }
      }
    }
  }

  const OccupancyView& view_;
  bool unknown_is_obstacle_;
  std::vector<std::uint64_t> obstacles_;  // as VoxelBits
  std::vector<Eigen::Vector3i> inserted_, removed_;
};

/// The closest obstacles of the map and, where the field is signed, of its inverse, as distances.
class Distances {
 public:
  virtual ~Distances() = default;
  virtual void update(const OccupancyChanges& changes) = 0;
  /// Flags the blocks in which a distance may have changed since the call before.
  virtual void mark_changed(std::vector<std::uint8_t>& block_changed) = 0;
  /// Distances of `count` voxels of a row from x on.
  virtual void row(int x, int y, int z, int count, float* distances_m) const = 0;
};

template <class Value>
class DistancesOf final : public Distances {
  using Obstacles = ClosestObstacles<Value>;
  using Start = typename Obstacles::Start;

 public:
  DistancesOf(const FieldInfo& info, std::uint32_t cap, const Options& options)
      : counts_(block_counts(info.grid)),
        distance_m_(edt::distance_table(info.grid.resolution_m, cap, info.max_distance_m)) {
    const auto steps = neighbourhood(std::stoi(options.connectivity));
    const bool starts_full = options.unknown == "occupied";
    outside_.emplace(info.grid.size_vox, cap, steps,
                     starts_full ? Start::kAllObstacles : Start::kNoObstacles);
    if (info.is_signed) {
      inside_.emplace(info.grid.size_vox, cap, steps,
                      starts_full ? Start::kNoObstacles : Start::kAllObstacles);
    }
  }

  void update(const OccupancyChanges& changes) override {
    outside_->update(changes.removed(), changes.inserted());
    if (inside_) inside_->update(changes.inserted(), changes.removed());
  }

  void mark_changed(std::vector<std::uint8_t>& block_changed) override {
    const auto mark = [&](int x, int y, int z) {
      const Eigen::Vector3i block(x / kBlockSide_vox, y / kBlockSide_vox, z / kBlockSide_vox);
      block_changed[static_cast<std::size_t>(block_linear(block, counts_))] = 1;
    };
    outside_->take_touched(mark);
    if (inside_) inside_->take_touched(mark);
  }

  void row(int x, int y, int z, int count, float* distances_m) const override {
    const Value* outside = outside_->row(y, z) + x;
    for (int i = 0; i < count; ++i) distances_m[i] = distance_m_[outside[i]];
    if (!inside_) return;
    const Value* inside = inside_->row(y, z) + x;
    for (int i = 0; i < count; ++i) distances_m[i] -= distance_m_[inside[i]];
  }

 private:
  Eigen::Vector3i counts_;
  std::vector<float> distance_m_;  // by squared distance in voxels
  std::optional<Obstacles> outside_, inside_;
};

class IncrementalBuilder final : public FieldBuilder {
 public:
  IncrementalBuilder(Options options, WorkerPool& workers)
      : options_(std::move(options)), workers_(workers) {}

  Result<void> attach(Mapper& mapper) override {
    const auto* view = dynamic_cast<const OccupancyView*>(&mapper);
    if (view == nullptr) {
      return fail(ErrorCode::kUnsupported, "the mapper offers no OccupancyView",
                  "field incremental", "the mappers voxel_grid and octomap offer it");
    }
    const double limit_m = options_.max_distance_m;
    const FieldInfo info{
        .grid = view->occupancy_grid(),
        .is_signed = options_.is_signed,
        .max_distance_m = limit_m > 0.0 ? limit_m : std::numeric_limits<double>::infinity()};
    const std::uint32_t cap = edt::cap_vox2(limit_m, info.grid);
    if (ClosestObstacles<std::uint16_t>::fits(info.grid.size_vox, cap)) {
      distances_ = std::make_unique<DistancesOf<std::uint16_t>>(info, cap, options_);
    } else if (ClosestObstacles<std::uint32_t>::fits(info.grid.size_vox, cap)) {
      distances_ = std::make_unique<DistancesOf<std::uint32_t>>(info, cap, options_);
    } else {
      return fail(ErrorCode::kUnsupported,
                  "the grid has more voxels, or a longer reach, than 32 bits can name",
                  "field incremental", "limit max_distance_m, or choose a smaller grid");
    }
    changes_.emplace(*view, options_.unknown == "occupied");
    publisher_.emplace(info, *view, workers_);
    first_ = true;
    return {};
  }

  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate& update) override {
    if (!publisher_) {
      return fail(ErrorCode::kInvalidArgument, "update() before attach()", "field incremental");
    }
    auto changed = SIDESTEP_TRY(publisher_->begin(update));
    changes_->find(changed);
    distances_->update(*changes_);
    // Where the map changed but no distance did, there is nothing to write again.
    if (!std::exchange(first_, false)) std::ranges::fill(changed, std::uint8_t{0});
    distances_->mark_changed(changed);
    return publisher_->publish(update, changed,
                               [this](int x, int y, int z, int count, float* distances_m) {
                                 distances_->row(x, y, z, count, distances_m);
                               });
  }

 private:
  Options options_;
  WorkerPool& workers_;
  bool first_ = true;
  std::unique_ptr<Distances> distances_;
  std::optional<OccupancyChanges> changes_;
  std::optional<DenseFieldPublisher> publisher_;
};

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext& context) {
  return make_incremental_builder(options, context.workers);
}

}  // namespace

std::unique_ptr<FieldBuilder> make_incremental_builder(const Options& options,
                                                       WorkerPool& workers) {
  return std::make_unique<IncrementalBuilder>(options, workers);
}

}  // namespace sidestep::incremental

SIDESTEP_PLUGIN(sidestep::FieldBuilder, sidestep::incremental::Options,
                sidestep::incremental::create, "incremental", "0.1.0",
                "Distances kept up to date by lists of closest obstacles (FIESTA, Han 2019)",
                sidestep::OccupancyView)
