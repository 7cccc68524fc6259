#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "line_kernels.hpp"
#include "transform.hpp"

namespace sidestep::edt_cuda {

/// What each pass has to bring up to date.
struct DirtyLines {
  std::vector<std::int32_t> rows;  ///< Of blocks, as ScanRows::items.
  std::vector<LinePart> along_y;
  std::vector<LinePart> along_z;
};

/// What a change of obstacles can reach, pass by pass. A value along x changes only in a changed
/// block's own rows, one along y only in its slices, and none farther away than the reach of the
/// cap along the axes passed.
class DirtyRegion {
 public:
  /// `reach`: the largest offset whose square is below the cap.
  DirtyRegion(const Shape& shape, int reach);

  /// All that the change of these blocks can reach. Valid until the next call.
  [[nodiscard]] const DirtyLines& of(std::span<const std::int32_t> blocks);
  [[nodiscard]] const DirtyLines& everything();

 private:
  /// Places [first, last] along an axis, in units of several voxels.
  struct Range {
    int first, last;
  };
  [[nodiscard]] Range reached(int block, int length, int unit) const;
  void mark(std::int32_t block);

  Shape shape_;
  int reach_;
  int tiles_, segments_y_, segments_z_;
  std::vector<std::uint8_t> rows_, along_y_, along_z_;
  DirtyLines lines_;
};

/// The transform on a backend: a cuda::HostBackend or a cuda::DeviceBackend.
template <class Backend, class Value>
class TransformOn final : public DistanceTransform {
 public:
  static Result<std::unique_ptr<DistanceTransform>> make(const TransformSettings& settings,
                                                         std::unique_ptr<Backend> backend) {
    std::unique_ptr<TransformOn> made(new TransformOn(settings, std::move(backend)));
    SIDESTEP_TRY(made->allocate());
    return made;
  }

  Result<std::span<std::uint16_t>> obstacle_rows(std::size_t blocks) override {
    const std::size_t rows = blocks * cuda::kBlockRows;
    SIDESTEP_TRY(cuda::grow_pinned(*backend_, rows_, rows));
    return std::span<std::uint16_t>(rows_.data(), rows);
  }

  Result<ChangedDistances> update(std::span<const std::int32_t> changed_blocks) override {
    const std::size_t rows = changed_blocks.size() * cuda::kBlockRows;
    SIDESTEP_TRY(cuda::grow(*backend_, packed_rows_, rows));
    begin(changed_blocks);
    backend_->upload(packed_rows_, 0, std::span<const std::uint16_t>(rows_.data(), rows));
    backend_->stage(cuda::Stage::kTransform);
    backend_->launch(TakeObstacles{shape_, dirty_blocks_.data(), packed_rows_.data(), nullptr,
                                   nullptr, obstacles_.data()},
                     static_cast<std::int64_t>(changed_blocks.size()));
    return transform(changed_blocks);
  }

  Result<ChangedDistances> update(std::span<const std::int32_t> changed_blocks,
                                  const cuda::OccupancyOnDevice& map,
                                  bool unknown_is_occupied) override {
    begin(changed_blocks);
    backend_->stage(cuda::Stage::kTransform);
    backend_->launch(TakeObstacles{shape_, dirty_blocks_.data(), nullptr, map.occupied,
                                   unknown_is_occupied ? map.known : nullptr, obstacles_.data()},
                     static_cast<std::int64_t>(changed_blocks.size()));
    return transform(changed_blocks);
  }

  int ordinal() const noexcept override { return backend_->ordinal(); }
  const cuda::StageTimes& times() const noexcept override { return backend_->times(); }

 private:
  /// Blocks are packed and copied to the host in parts of so many, at once.
  static constexpr std::size_t kBlocksAtOnce = 128;

  TransformOn(const TransformSettings& settings, std::unique_ptr<Backend> backend)
      : backend_(std::move(backend)),
        shape_(shape_of(settings.size_vox)),
        cap_(static_cast<int>(settings.cap)),
        reach_(reach_of(settings.cap)),
        is_signed_(settings.is_signed),
        region_(shape_, reach_) {}

  static Shape shape_of(const cuda::Extent& size) {
    const auto blocks = [](int length) {
      return (length + cuda::kBlockSide - 1) / cuda::kBlockSide;
    };
    return {size,
            {blocks(size.x), blocks(size.y), blocks(size.z)},
            static_cast<std::ptrdiff_t>(size.x + cuda::kWarp - 1) / cuda::kWarp * cuda::kWarp};
  }
  static int reach_of(std::uint32_t cap) {
    return static_cast<int>(std::ceil(std::sqrt(static_cast<double>(cap)))) - 1;
  }

  [[nodiscard]] std::size_t block_count() const {
    return static_cast<std::size_t>(shape_.blocks.x) * static_cast<std::size_t>(shape_.blocks.y) *
           static_cast<std::size_t>(shape_.blocks.z);
  }

  Result<void> allocate() {
    const auto values = static_cast<std::size_t>(shape_.values());
    Result<void> all;
    const auto take = [&](auto& memory, std::size_t count) {
      if (all) all = cuda::renew(*backend_, memory, count);
    };
    take(obstacles_, block_count() * cuda::kBlockRows);
    take(along_x_, values);
    take(along_y_, values);
    take(along_z_, values);
    take(changed_, block_count());
    take(dirty_blocks_, block_count());
    const DirtyLines& lines = region_.everything();
    take(dirty_rows_, lines.rows.size());
    take(dirty_along_y_, lines.along_y.size());
    take(dirty_along_z_, lines.along_z.size());
    if (all) all = cuda::grow_pinned(*backend_, changed_on_host_, block_count());
    return all;
  }

  void begin(std::span<const std::int32_t> changed_blocks) {
    backend_->enter();
    backend_->stage(cuda::Stage::kUpload);
    backend_->upload(dirty_blocks_, 0, changed_blocks);
  }

  /// The three passes over what the blocks can reach, and what came of it.
  Result<ChangedDistances> transform(std::span<const std::int32_t> changed_blocks) {
    const DirtyLines& lines = is_first_ ? region_.everything() : region_.of(changed_blocks);
    backend_->upload(dirty_rows_, 0, std::span<const std::int32_t>(lines.rows));
    backend_->upload(dirty_along_y_, 0, std::span<const LinePart>(lines.along_y));
    backend_->upload(dirty_along_z_, 0, std::span<const LinePart>(lines.along_z));
    backend_->clear(changed_);
    const ScanRows<Value> scan{shape_, dirty_rows_.data(), obstacles_.data(), along_x_.data(), cap_,
                               reach_, is_signed_};
    backend_->launch(
        scan, static_cast<std::int64_t>(lines.rows.size()) * ScanRows<Value>::kBlocksPerItem);
    const Envelope<Value> along_y{
        shape_, dirty_along_y_.data(), along_x_.data(), along_y_.data(), nullptr, cap_, false};
    backend_->launch(along_y, static_cast<std::int64_t>(lines.along_y.size()) * cuda::kBlockSide);
    const Envelope<Value> along_z{
        shape_, dirty_along_z_.data(), along_y_.data(), along_z_.data(), changed_.data(), cap_,
        true};
    backend_->launch(along_z, static_cast<std::int64_t>(lines.along_z.size()) * cuda::kBlockSide);
    backend_->stage(cuda::Stage::kDownload);
    backend_->download(std::span<std::uint8_t>(changed_on_host_.data(), block_count()), changed_,
                       0);
    SIDESTEP_TRY(backend_->finish());
    changed_blocks_.clear();
    for (std::size_t b = 0; b < block_count(); ++b) {
      if (is_first_ || changed_on_host_.data()[b] != 0) {
        changed_blocks_.push_back(static_cast<std::int32_t>(b));
      }
    }
    is_first_ = false;
    return bring_home();
  }

  /// Copies the values of changed_blocks_ to the host.
  Result<ChangedDistances> bring_home() {
    const std::size_t count = changed_blocks_.size();
    const std::size_t values = count * cuda::kBlockVoxels;
    SIDESTEP_TRY(cuda::grow(*backend_, packed_values_, values));
    SIDESTEP_TRY(cuda::grow_pinned(*backend_, values_, values));
    backend_->stage(cuda::Stage::kDownload);
    backend_->upload(dirty_blocks_, 0, std::span<const std::int32_t>(changed_blocks_));
    for (std::size_t first = 0; first < count; first += kBlocksAtOnce) {
      const std::size_t blocks = std::min(kBlocksAtOnce, count - first);
      const std::size_t at = first * cuda::kBlockVoxels;
      backend_->launch(PackBlocks<Value>{shape_, dirty_blocks_.data() + first, along_z_.data(),
                                         packed_values_.data() + at},
                       static_cast<std::int64_t>(blocks));
      backend_->download(std::span<Value>(values_.data() + at, blocks * cuda::kBlockVoxels),
                         packed_values_, at);
    }
    SIDESTEP_TRY(backend_->finish());
    ChangedDistances changed{changed_blocks_, {}, {}};
    const std::span<const Value> packed(values_.data(), values);
    if constexpr (sizeof(Value) == sizeof(std::int16_t)) {
      changed.near_vox2 = packed;
    } else {
      changed.far_vox2 = packed;
    }
    return changed;
  }

  std::unique_ptr<Backend> backend_;  // goes last: memory is given back to it
  Shape shape_;
  int cap_;
  int reach_;
  bool is_signed_;
  bool is_first_ = true;
  DirtyRegion region_;
  std::vector<std::int32_t> changed_blocks_;
  // On the device.
  cuda::Memory<std::uint16_t> obstacles_, packed_rows_;
  cuda::Memory<Value> along_x_, along_y_, along_z_, packed_values_;
  cuda::Memory<std::uint8_t> changed_;
  cuda::Memory<std::int32_t> dirty_blocks_, dirty_rows_;
  cuda::Memory<LinePart> dirty_along_y_, dirty_along_z_;
  // On the host.
  cuda::Memory<std::uint16_t> rows_;
  cuda::Memory<std::uint8_t> changed_on_host_;
  cuda::Memory<Value> values_;
};

/// The transform with values as narrow as the cap allows. Fails with kUnsupported where the grid is
/// too large.
template <class Backend>
Result<std::unique_ptr<DistanceTransform>> make_transform_on(const TransformSettings& settings,
                                                             std::unique_ptr<Backend> backend) {
  constexpr int kLongest = 1 << 15;  // so that the square of an offset fits 32 bits
  const cuda::Extent& size = settings.size_vox;
  if (std::max({size.x, size.y, size.z}) > kLongest) {
    return fail(ErrorCode::kUnsupported, "the grid is too large", "field edt_cuda",
                "at most " + std::to_string(kLongest) + " voxels along each axis");
  }
  if (settings.cap > DistanceTransform::kLargestCap) {
    return fail(ErrorCode::kUnsupported, "the grid is too large for distances without a limit",
                "field edt_cuda", "set max_distance_m to at most 8192 voxels");
  }
  if (settings.cap <= DistanceTransform::kLargestNearCap) {
    return TransformOn<Backend, std::int16_t>::make(settings, std::move(backend));
  }
  return TransformOn<Backend, std::int32_t>::make(settings, std::move(backend));
}

}  // namespace sidestep::edt_cuda
