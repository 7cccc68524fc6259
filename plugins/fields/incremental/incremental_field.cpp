#include "incremental_field.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <sidestep/mapping/dense_field_publisher.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

#include "closest_obstacles.hpp"
#include "neighbourhood.hpp"
#include "occupancy_changes.hpp"

namespace sidestep::incremental {
namespace {

/// The first squared distance, in voxels, at or beyond the limit.
std::uint32_t cap_vox2(double max_distance_m, const GridSpec& grid) {
  const double diagonal2 = grid.size_vox.cast<double>().squaredNorm();
  if (max_distance_m <= 0.0) return static_cast<std::uint32_t>(diagonal2);
  const double limit = max_distance_m / grid.resolution_m;
  const double cap = std::ceil(limit * limit * (1.0 - 1e-12));
  return static_cast<std::uint32_t>(std::clamp(cap, 1.0, diagonal2));
}

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
      : counts_(block_counts(info.grid)), distance_m_(cap + std::size_t{1}) {
    const auto steps = neighbourhood(std::stoi(options.connectivity));
    const bool starts_full = options.unknown == "occupied";
    outside_.emplace(info.grid.size_vox, cap, steps,
                     starts_full ? Start::kAllObstacles : Start::kNoObstacles);
    if (info.is_signed) {
      inside_.emplace(info.grid.size_vox, cap, steps,
                      starts_full ? Start::kNoObstacles : Start::kAllObstacles);
    }
    for (std::size_t d2 = 0; d2 < distance_m_.size(); ++d2) {
      distance_m_[d2] =
          static_cast<float>(info.grid.resolution_m * std::sqrt(static_cast<double>(d2)));
    }
    if (std::isfinite(info.max_distance_m)) {
      distance_m_[cap] = static_cast<float>(info.max_distance_m);
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
    const std::uint32_t cap = cap_vox2(limit_m, info.grid);
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

}  // namespace

std::unique_ptr<FieldBuilder> make_incremental_builder(const Options& options,
                                                       WorkerPool& workers) {
  return std::make_unique<IncrementalBuilder>(options, workers);
}

}  // namespace sidestep::incremental
