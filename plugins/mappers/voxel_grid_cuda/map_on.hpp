#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "log_odds_map.hpp"

namespace sidestep::voxel_grid_cuda {

/// The map on a backend: a cuda::HostBackend or a cuda::DeviceBackend.
template <class Backend>
class MapOn final : public LogOddsMap {
 public:
  static Result<std::unique_ptr<LogOddsMap>> make(const MapSettings& settings,
                                                  std::unique_ptr<Backend> backend) {
    std::unique_ptr<MapOn> made(new MapOn(settings, std::move(backend)));
    SIDESTEP_TRY(made->allocate());
    return made;
  }

  Result<MapChange> integrate(const ImageFrame& frame) override {
    const int width = frame.view.width_px;
    const int height = frame.view.height_px;
    const int tiles_u = (width + kImageTile - 1) / kImageTile;
    const int tiles = tiles_u * ((height + kImageTile - 1) / kImageTile);
    Result<void> room = cuda::grow(*backend_, depth_m_, frame.depth_m.size());
    if (room) room = cuda::grow(*backend_, carve_m_, frame.depth_m.size());
    if (room) room = cuda::grow(*backend_, tiles_, static_cast<std::size_t>(tiles));
    if (room) room = cuda::grow(*backend_, lines_, frame.lines.size());
    if (room) room = cuda::grow(*backend_, balls_, frame.balls.size());
    if (room) room = cuda::grow_pinned(*backend_, pinned_depth_m_, frame.depth_m.size());
    if (!room) return error_of(room);

    begin();
    upload_depth(frame.depth_m);
    backend_->upload(lines_, 0, frame.lines);
    backend_->upload(balls_, 0, frame.balls);
    backend_->stage(cuda::Stage::kIntegrate);
    backend_->launch(classify(frame), blocks_of(frame.depth_m.size(), ClassifyPixels::kThreads));
    backend_->launch(ReduceTiles{width, height, tiles_u, carve_m_.data(), tiles_.data()}, tiles);
    backend_->launch(
        IntegrateImage{grid_, hits(), frame.view, tiles_u, carve_m_.data(), tiles_.data()},
        block_count());
    return bring_home();
  }

  Result<MapChange> integrate(const RayFrame& frame) override {
    const std::size_t count = std::max(frame.cloud.size(), frame.depth_m.size());
    Result<void> room = make_room_for_rays(count);
    if (room) room = cuda::grow(*backend_, world_balls_, frame.balls.size());
    if (room) room = cuda::grow(*backend_, cloud_, frame.cloud.size());
    if (room) room = cuda::grow(*backend_, depth_m_, frame.depth_m.size());
    if (room) room = cuda::grow_pinned(*backend_, pinned_depth_m_, frame.depth_m.size());
    if (!room) return error_of(room);

    begin();
    backend_->upload(cloud_, 0, frame.cloud);
    upload_depth(frame.depth_m);
    backend_->upload(world_balls_, 0, frame.balls);
    backend_->stage(cuda::Stage::kIntegrate);
    backend_->launch(mark_ends(frame, count), blocks_of(count, MarkEnds::kThreads));
    std::uint32_t* ray_count = counts_.data() + kFates;
    backend_->launch(GatherRays{grid_, hits(), free_ends(), rays_.data(), ray_count},
                     block_count());
    backend_->launch(WalkRays{grid_, misses(), frame.camera_vox, rays_.data(), ray_count},
                     blocks_of(count, WalkRays::kThreads));
    backend_->launch(IntegrateMarks{grid_, hits(), misses(), free_ends()}, block_count());
    const auto blocks = static_cast<std::size_t>(block_count());
    backend_->launch(ForgetMarks{grid_, hits(), misses(), free_ends(), block_count()},
                     blocks_of(blocks, ForgetMarks::kThreads));
    return bring_home();
  }

  cuda::OccupancyOnDevice occupancy() const noexcept override {
    return {occupied_.data(), known_.data(), backend_->ordinal()};
  }

  Result<std::vector<std::int16_t>> log_odds() override {
    std::vector<HalfRow> rows(log_odds_.size());
    backend_->enter();
    backend_->download(std::span<HalfRow>(rows), log_odds_, 0);
    SIDESTEP_TRY(backend_->finish());
    std::vector<std::int16_t> values;
    values.reserve(rows.size() * std::size(rows.front().values));
    for (const HalfRow& row : rows) {
      values.insert(values.end(), std::begin(row.values), std::end(row.values));
    }
    return values;
  }

  const cuda::StageTimes& times() const noexcept override { return backend_->times(); }

 private:
  static constexpr std::size_t kBlocksAtOnce = 256;
  static constexpr std::size_t kCounts = kFates + 1;  ///< The last is that of rays.

  MapOn(const MapSettings& settings, std::unique_ptr<Backend> backend)
      : backend_(std::move(backend)) {
    const auto blocks = [](int length) {
      return (length + cuda::kBlockSide - 1) / cuda::kBlockSide;
    };
    grid_.size = settings.size_vox;
    grid_.blocks = {blocks(grid_.size.x), blocks(grid_.size.y), blocks(grid_.size.z)};
    grid_.model = settings.model;
  }

  [[nodiscard]] std::int64_t block_count() const {
    return std::int64_t{grid_.blocks.x} * grid_.blocks.y * grid_.blocks.z;
  }
  static std::int64_t blocks_of(std::size_t threads, int each) {
    return (static_cast<std::int64_t>(threads) + each - 1) / each;
  }

  Result<void> allocate() {
    const auto blocks = static_cast<std::size_t>(block_count());
    const std::size_t rows = blocks * cuda::kBlockRows;
    Result<void> all = cuda::grow(*backend_, log_odds_, 2 * rows);
    if (all) all = cuda::grow(*backend_, occupied_, rows);
    if (all) all = cuda::grow(*backend_, known_, rows);
    if (all) all = cuda::grow(*backend_, settled_, blocks);
    if (all) all = cuda::grow(*backend_, changed_, blocks);
    if (all) all = cuda::grow(*backend_, hit_words_, rows / 2);
    if (all) all = cuda::grow(*backend_, hit_blocks_, blocks);
    if (all) all = cuda::grow(*backend_, counts_, kCounts);
    if (all) all = cuda::grow(*backend_, changed_list_, blocks);
    if (all) all = cuda::grow_pinned(*backend_, changed_on_host_, blocks);
    if (all) all = cuda::grow_pinned(*backend_, counts_on_host_, kCounts);
    if (!all) return all;
    grid_.log_odds = log_odds_.data();
    grid_.occupied = occupied_.data();
    grid_.known = known_.data();
    grid_.settled = settled_.data();
    grid_.changed = changed_.data();
    return {};
  }
  /// What only ray casting needs, when it is first needed.
  Result<void> make_room_for_rays(std::size_t count) {
    const auto blocks = static_cast<std::size_t>(block_count());
    Result<void> all = cuda::grow(*backend_, rays_, count);
    for (auto* words : {&miss_words_, &end_words_}) {
      if (all) all = cuda::grow(*backend_, *words, blocks * cuda::kBlockRows / 2);
    }
    for (auto* flags : {&miss_blocks_, &end_blocks_}) {
      if (all) all = cuda::grow(*backend_, *flags, blocks);
    }
    return all;
  }

  [[nodiscard]] Marks hits() { return {hit_words_.data(), hit_blocks_.data()}; }
  [[nodiscard]] Marks misses() { return {miss_words_.data(), miss_blocks_.data()}; }
  [[nodiscard]] Marks free_ends() { return {end_words_.data(), end_blocks_.data()}; }

  void begin() {
    backend_->enter();
    backend_->stage(cuda::Stage::kUpload);
    backend_->clear(counts_);
    backend_->clear(changed_);
  }
  void upload_depth(std::span<const float> depth_m) {
    const std::span<float> pinned(pinned_depth_m_.data(), depth_m.size());
    std::ranges::copy(depth_m, pinned.begin());
    backend_->upload(depth_m_, 0, std::span<const float>(pinned));
  }

  ClassifyPixels classify(const ImageFrame& frame) {
    ClassifyPixels kernel;
    kernel.grid = grid_;
    kernel.hits = hits();
    kernel.rules = frame.rules;
    kernel.width = frame.view.width_px;
    kernel.height = frame.view.height_px;
    kernel.x_first = frame.x_first;
    kernel.x_step = frame.x_step;
    std::ranges::copy(frame.start_vox, kernel.start_vox);
    std::ranges::copy(frame.across_vox, kernel.across_vox);
    kernel.lines = lines_.data();
    kernel.balls = balls_.data();
    kernel.ball_count = static_cast<int>(frame.balls.size());
    kernel.depth_m = depth_m_.data();
    kernel.carve_m = carve_m_.data();
    kernel.counts = counts_.data();
    return kernel;
  }

  MarkEnds mark_ends(const RayFrame& frame, std::size_t count) {
    MarkEnds kernel;
    kernel.grid = grid_;
    kernel.hits = hits();
    kernel.free_ends = free_ends();
    kernel.limits = frame.limits;
    for (int row = 0; row < 3; ++row) {
      std::ranges::copy(frame.T_world_camera[row], kernel.T_world_camera[row]);
    }
    kernel.origin_m = frame.origin_m;
    kernel.camera_vox = frame.camera_vox;
    kernel.resolution_m = frame.resolution_m;
    kernel.fx_px = frame.fx_px;
    kernel.fy_px = frame.fy_px;
    kernel.cx_px = frame.cx_px;
    kernel.cy_px = frame.cy_px;
    kernel.balls = world_balls_.data();
    kernel.ball_count = static_cast<int>(frame.balls.size());
    kernel.balls_lower_m = frame.balls_lower_m;
    kernel.balls_upper_m = frame.balls_upper_m;
    kernel.count = static_cast<std::int64_t>(count);
    kernel.cloud = frame.depth_m.empty() ? cloud_.data() : nullptr;
    kernel.depth_m = depth_m_.data();
    kernel.width = frame.width_px;
    kernel.counts = counts_.data();
    return kernel;
  }

  /// Copies the blocks that changed to the host, in parts while later ones are gathered.
  Result<MapChange> bring_home() {
    const auto blocks = static_cast<std::size_t>(block_count());
    backend_->stage(cuda::Stage::kDownload);
    backend_->download(std::span<std::uint8_t>(changed_on_host_.data(), blocks), changed_, 0);
    backend_->download(std::span<std::uint32_t>(counts_on_host_.data(), kCounts), counts_, 0);
    SIDESTEP_TRY(backend_->finish());
    changed_blocks_.clear();
    for (std::size_t b = 0; b < blocks; ++b) {
      if (changed_on_host_.data()[b] != 0) changed_blocks_.push_back(static_cast<std::int32_t>(b));
    }
    MapChange change;
    std::copy_n(counts_on_host_.data(), kFates, change.fates.begin());
    change.blocks = changed_blocks_;

    constexpr std::size_t kRows = 2 * cuda::kBlockRows;
    const std::size_t rows = changed_blocks_.size() * kRows;
    Result<void> room = cuda::grow(*backend_, packed_, rows);
    if (room) room = cuda::grow_pinned(*backend_, rows_, rows);
    if (!room) return error_of(room);
    backend_->stage(cuda::Stage::kDownload);
    backend_->upload(changed_list_, 0, std::span<const std::int32_t>(changed_blocks_));
    for (std::size_t first = 0; first < changed_blocks_.size(); first += kBlocksAtOnce) {
      const std::size_t part = std::min(kBlocksAtOnce, changed_blocks_.size() - first);
      backend_->launch(PackBits{changed_list_.data() + first, occupied_.data(), known_.data(),
                                packed_.data() + first * kRows},
                       static_cast<std::int64_t>(part));
      backend_->download(std::span<std::uint16_t>(rows_.data() + first * kRows, part * kRows),
                         packed_, first * kRows);
    }
    SIDESTEP_TRY(backend_->finish());
    change.rows = {rows_.data(), rows};
    return change;
  }

  std::unique_ptr<Backend> backend_;  // goes last: memory is given back to it
  Grid grid_;
  std::vector<std::int32_t> changed_blocks_;
  // On the device: the map,
  cuda::Memory<HalfRow> log_odds_;
  cuda::Memory<std::uint16_t> occupied_, known_, packed_;
  cuda::Memory<std::uint8_t> settled_, changed_;
  cuda::Memory<std::int32_t> changed_list_;
  // a frame,
  cuda::Memory<float> depth_m_, carve_m_;
  cuda::Memory<CloudPoint> cloud_;
  cuda::Memory<PixelLine> lines_;
  cuda::Memory<Ball> balls_;
  cuda::Memory<WorldBall> world_balls_;
  // and what it says.
  cuda::Memory<Bounds> tiles_;
  cuda::Memory<std::uint32_t> hit_words_, miss_words_, end_words_, counts_;
  cuda::Memory<std::uint8_t> hit_blocks_, miss_blocks_, end_blocks_;
  cuda::Memory<Ray> rays_;
  // On the host.
  cuda::Memory<float> pinned_depth_m_;
  cuda::Memory<std::uint8_t> changed_on_host_;
  cuda::Memory<std::uint32_t> counts_on_host_;
  cuda::Memory<std::uint16_t> rows_;
};

}  // namespace sidestep::voxel_grid_cuda
