#include "edt_cuda_field.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include <sidestep/mapping/dense_field_publisher.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep::edt_cuda {
namespace {

constexpr int kSide = kBlockSide_vox;
static_assert(kSide == cuda::kBlockSide && FieldBlock::kVoxels == cuda::kBlockVoxels);

/// Obstacles of an OccupancyView, block by block.
class ObstacleReader {
 public:
  ObstacleReader(const OccupancyView& view, bool unknown_is_occupied)
      : view_(view), unknown_is_occupied_(unknown_is_occupied) {}

  /// Fills the rows of a block.
  void read(std::int32_t block, std::uint16_t* rows) const {
    const GridSpec& grid = view_.occupancy_grid();
    const Eigen::Vector3i counts = block_counts(grid);
    const int bx = block % counts.x();
    const int first_y = block / counts.x() % counts.y() * kSide;
    const int first_z = block / (counts.x() * counts.y()) * kSide;
    const int left = grid.size_vox.x() - bx * kSide;
    const std::uint32_t inside = left >= kSide ? 0xffffu : (1u << left) - 1u;
    const VoxelBits occupied = view_.occupied();
    const VoxelBits known = view_.known();
    for (int row = 0; row < cuda::kBlockRows; ++row) {
      const int y = first_y + row % kSide;
      const int z = first_z + row / kSide;
      rows[row] = 0;
      if (y >= grid.size_vox.y() || z >= grid.size_vox.z()) continue;
      const std::size_t line =
          static_cast<std::size_t>(y) +
          static_cast<std::size_t>(grid.size_vox.y()) * static_cast<std::size_t>(z);
      const std::size_t word = line * static_cast<std::size_t>(occupied.words_per_row) +
                               static_cast<std::size_t>(bx / 4);
      const std::uint64_t unknown = unknown_is_occupied_ ? ~known.words[word] : 0;
      rows[row] = static_cast<std::uint16_t>(
          ((occupied.words[word] | unknown) >> (bx % 4 * kSide)) & inside);
    }
  }

 private:
  const OccupancyView& view_;
  bool unknown_is_occupied_;
};

/// Blocks of squared distances as distances in metres, row by row.
class ChangedRows {
 public:
  ChangedRows(const ChangedDistances& changed, const Eigen::Vector3i& counts,
              const std::vector<float>& table_m)
      : changed_(changed),
        counts_(counts),
        table_m_(table_m),
        place_(static_cast<std::size_t>(counts.prod()), 0) {
    for (std::size_t i = 0; i < changed.blocks.size(); ++i) {
      place_[static_cast<std::size_t>(changed.blocks[i])] = i;
    }
  }

  void write(int x, int y, int z, int count, float* distances_m) const {
    const std::int32_t block = block_linear({x / kSide, y / kSide, z / kSide}, counts_);
    const std::size_t at = place_[static_cast<std::size_t>(block)] * cuda::kBlockVoxels +
                           static_cast<std::size_t>(kSide * (y % kSide + kSide * (z % kSide)));
    if (changed_.far_vox2.empty()) {
      convert(changed_.near_vox2.data() + at, count, distances_m);
    } else {
      convert(changed_.far_vox2.data() + at, count, distances_m);
    }
  }

 private:
  template <class Value>
  void convert(const Value* vox2, int count, float* distances_m) const {
    for (int i = 0; i < count; ++i) {
      const int value = vox2[i];
      distances_m[i] = value < 0 ? -table_m_[static_cast<std::size_t>(-value)]
                                 : table_m_[static_cast<std::size_t>(value)];
    }
  }

  const ChangedDistances& changed_;
  Eigen::Vector3i counts_;
  const std::vector<float>& table_m_;
  std::vector<std::size_t> place_;  ///< By block: its number in changed_.
};

class EdtCudaBuilder final : public FieldBuilder {
 public:
  EdtCudaBuilder(Options options, WorkerPool& workers, Log& log, MakeTransform make)
      : options_(std::move(options)), workers_(workers), log_(log), make_(std::move(make)) {}

  Result<void> attach(Mapper& mapper) override {
    mapper_ = &mapper;
    if (cpu_ != nullptr) return cpu_->attach(mapper);
    view_ = dynamic_cast<const OccupancyView*>(&mapper);
    if (view_ == nullptr) {
      return fail(ErrorCode::kUnsupported, "the mapper offers no OccupancyView", "field edt_cuda");
    }
    device_view_ = dynamic_cast<const cuda::DeviceOccupancyView*>(&mapper);
    grid_ = view_->occupancy_grid();
    const std::uint32_t cap = edt::cap_vox2(options_.max_distance_m, grid_);
    const Eigen::Vector3i& size = grid_.size_vox;
    transform_.reset();  // given back first: both may not fit
    auto made = make_({{size.x(), size.y(), size.z()}, cap, options_.is_signed});
    if (!made) return fall_back(std::move(made.error()));
    transform_ = std::move(*made);
    const double limit_m = options_.max_distance_m > 0.0 ? options_.max_distance_m
                                                         : std::numeric_limits<double>::infinity();
    table_m_ = edt::distance_table(grid_.resolution_m, cap, limit_m);
    publisher_.emplace(FieldInfo{.grid = grid_,
                                 .is_signed = options_.is_signed,
                                 .max_distance_m = limit_m,
                                 .lipschitz = 1.0},
                       *view_, workers_);
    first_ = true;
    return {};
  }

  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate& update) override {
    if (cpu_ != nullptr) return cpu_->update(update);
    if (!publisher_) {
      return fail(ErrorCode::kInvalidArgument, "update() before attach()", "field edt_cuda");
    }
    auto flags = SIDESTEP_TRY(publisher_->begin(update));
    const auto changed = transformed(update.changed_blocks);
    if (!changed) {
      SIDESTEP_TRY(fall_back(changed.error()));
      return cpu_->update(update);
    }
    // Where voxels have only become known, distances stay as they are.
    std::ranges::fill(flags, std::uint8_t{0});
    for (const std::int32_t block : changed->blocks) flags[static_cast<std::size_t>(block)] = 1;
    const ChangedRows rows(*changed, block_counts(grid_), table_m_);
    return publisher_->publish(update, flags,
                               [&](int x, int y, int z, int count, float* distances_m) {
                                 rows.write(x, y, z, count, distances_m);
                               });
  }

 private:
  /// Brings the transform up to date with the map's blocks that changed, all of them at first.
  Result<ChangedDistances> transformed(std::span<const std::int32_t> changed_blocks) {
    if (std::exchange(first_, false)) {
      blocks_.resize(static_cast<std::size_t>(block_counts(grid_).prod()));
      std::iota(blocks_.begin(), blocks_.end(), 0);
    } else {
      blocks_.assign(changed_blocks.begin(), changed_blocks.end());
    }
    const bool unknown_is_occupied = options_.unknown == "occupied";
    if (device_view_ != nullptr) {
      const auto map = device_view_->occupancy_on_device();
      if (map && map->ordinal == transform_->ordinal()) {
        return transform_->update(blocks_, *map, unknown_is_occupied);
      }
    }
    const auto rows = SIDESTEP_TRY(transform_->obstacle_rows(blocks_.size()));
    const ObstacleReader reader(*view_, unknown_is_occupied);
    workers_.run_banded(static_cast<int>(blocks_.size()), 64, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) {
        const auto at = static_cast<std::size_t>(i);
        reader.read(blocks_[at], rows.data() + at * cuda::kBlockRows);
      }
    });
    return transform_->update(blocks_);
  }

  /// Goes on with the CPU's builder from here, where that is wanted.
  Result<void> fall_back(Error why) {
    if (options_.fallback != "cpu") {
      if (why.hint.empty()) why.hint = "fallback: cpu goes on with the field edt";
      return tl::make_unexpected(std::move(why));
    }
    log_.warn("field edt_cuda goes on as edt, on the CPU: " + why.describe());
    transform_.reset();
    publisher_.reset();
    cpu_ = edt::make_edt_builder(options_, workers_);
    return cpu_->attach(*mapper_);
  }

  Options options_;
  WorkerPool& workers_;
  Log& log_;
  MakeTransform make_;
  Mapper* mapper_ = nullptr;
  const OccupancyView* view_ = nullptr;
  const cuda::DeviceOccupancyView* device_view_ = nullptr;
  GridSpec grid_;
  std::vector<float> table_m_;
  std::unique_ptr<DistanceTransform> transform_;
  std::optional<DenseFieldPublisher> publisher_;
  std::vector<std::int32_t> blocks_;
  bool first_ = true;
  std::unique_ptr<FieldBuilder> cpu_;  ///< Once the device has failed.
};

}  // namespace

std::unique_ptr<FieldBuilder> make_edt_cuda_builder(const Options& options, WorkerPool& workers,
                                                    Log& log, MakeTransform make) {
  return std::make_unique<EdtCudaBuilder>(options, workers, log, std::move(make));
}

}  // namespace sidestep::edt_cuda
