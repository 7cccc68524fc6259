#include "voxel_grid_cuda.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include <sidestep/mapping/frame_check.hpp>
#include <sidestep/mapping/ray_ends.hpp>

#include "camera_view.hpp"

namespace sidestep::voxel_grid_cuda {
namespace {

constexpr int kSide = kBlockSide_vox;
static_assert(kSide == cuda::kBlockSide);
static_assert(kPixelChunk == voxel_grid::kPixelChunk && kImageTile == voxel_grid::kTile_px);
static_assert(kInsert == static_cast<int>(PointFate::kInsert) &&
              kFloor == static_cast<int>(PointFate::kFloor) &&
              kOutOfRange == static_cast<int>(PointFate::kOutOfRange) &&
              kInvalid == static_cast<int>(PointFate::kInvalid) &&
              kSelf == voxel_grid::PixelFates::kSelf &&
              kOutside == voxel_grid::PixelFates::kOutside);
static_assert(sizeof(CloudPoint) == sizeof(Eigen::Vector3f));

Point point(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

MapSettings settings_of(const Options& options) {
  const voxel_grid::LogOdds model = voxel_grid::log_odds_of(options);
  const Eigen::Vector3i& size = options.size_vox;
  return {{size.x(), size.y(), size.z()},
          {model.hit, model.miss, model.min, model.max, model.occupied_at}};
}

IntegrationCounts counts_of(const MapChange& change) {
  IntegrationCounts counts;
  counts.inserted = change.fates[kInsert];
  counts.floor = change.fates[kFloor];
  counts.out_of_range = change.fates[kOutOfRange];
  counts.invalid = change.fates[kInvalid];
  counts.self = change.fates[kSelf];
  counts.outside_grid = change.fates[kOutside];
  counts.points =
      counts.inserted + counts.floor + counts.out_of_range + counts.self + counts.outside_grid;
  return counts;
}

View view_of(const Options& options, const Frame& frame, const CameraIntrinsics& camera,
             const GridSpec& grid) {
  const voxel_grid::GridView over =
      voxel_grid::view_of_grid(frame, camera, grid, voxel_grid::band_m(options));
  View view;
  view.width_px = camera.width_px;
  view.height_px = camera.height_px;
  view.near_m = voxel_grid::kNear_m;
  std::ranges::copy(over.projection.margin_px_m, view.margin_px_m);
  view.band_m = over.projection.band_m;
  view.depth_slack_m = voxel_grid::kDepthSlack_m;
  view.pixel_slack = voxel_grid::kPixelSlack;
  view.first_surface_layer = voxel_grid::first_surface_layer(options);
  for (int c = 0; c < 3; ++c) {
    view.base[c] = over.base[c];
    for (int axis = 0; axis < 3; ++axis) view.columns[axis][c] = over.columns(c, axis);
  }
  return view;
}

Error unusable(Error why) {
  if (why.hint.empty()) why.hint = "fallback: cpu goes on with the mapper voxel_grid";
  return why;
}

/// Sets 16 bits of a row of words.
void set_row(std::uint64_t& word, int shift, std::uint16_t bits) {
  word = (word & ~(std::uint64_t{0xffff} << shift)) | (std::uint64_t{bits} << shift);
}

}  // namespace

Parameters<Options> Options::parameters() {
  return declare_measurement(std::move(
      voxel_grid::declare_sensor_model(declare_grid(Parameters<Options>()))
          .add("device", &Options::device, "Number of the CUDA device, counted from 0.", {.min = 0})
          .add("fallback", &Options::fallback,
               "What happens where the device cannot be used, or is lost: none: an error; "
               "cpu: the run goes on with voxel_grid, and the log says so.",
               {.choices = {"none", "cpu"}})));
}

VoxelGridCuda::VoxelGridCuda(const Options& options, const HostContext& context,
                             std::unique_ptr<LogOddsMap> map)
    : options_(options),
      context_(context),
      grid_(options.grid()),
      self_(context.robot, options.self_filter_margin_m),
      map_(std::move(map)),
      words_per_row_((grid_.size_vox.x() + 63) / 64),
      occupied_(static_cast<std::size_t>(words_per_row_) *
                static_cast<std::size_t>(grid_.size_vox.y()) *
                static_cast<std::size_t>(grid_.size_vox.z())),
      known_(occupied_.size()) {}

VoxelBits VoxelGridCuda::occupied() const noexcept {
  return cpu_ != nullptr ? cpu_->occupied() : VoxelBits{occupied_, words_per_row_};
}
VoxelBits VoxelGridCuda::known() const noexcept {
  return cpu_ != nullptr ? cpu_->known() : VoxelBits{known_, words_per_row_};
}

std::optional<cuda::OccupancyOnDevice> VoxelGridCuda::occupancy_on_device() const noexcept {
  if (map_ == nullptr) return std::nullopt;
  return map_->occupancy();
}

Result<MapUpdate> VoxelGridCuda::integrate(const Frame& frame) {
  if (cpu_ != nullptr) {
    auto update = cpu_->integrate(frame);
    if (update) update->sequence = ++sequence_;
    return update;
  }
  SIDESTEP_TRY(check_frame(frame));
  const auto* image = std::get_if<DepthImage>(&frame.measurement);
  if (image == nullptr && options_.method == "projective") {
    return fail(ErrorCode::kUnsupported, "method projective needs depth images, not point clouds",
                "frame " + std::to_string(frame.sequence), "set method to auto or raycast");
  }
  SIDESTEP_TRY(self_.pose(frame));

  const bool is_projective = image != nullptr && options_.method != "raycast";
  const auto change = is_projective ? integrate_image(frame, *image) : cast_rays(frame);
  if (!change) {
    if (options_.fallback != "cpu") return tl::make_unexpected(unusable(change.error()));
    return begin_anew(frame, change.error());
  }
  take_over(*change);
  MapUpdate update;
  update.counts = counts_of(*change);
  update.sequence = ++sequence_;
  update.stamp = frame.stamp;
  update.changed_blocks.assign(change->blocks.begin(), change->blocks.end());
  return update;
}

Result<MapChange> VoxelGridCuda::integrate_image(const Frame& frame, const DepthImage& image) {
  const CameraIntrinsics& camera = image.camera;
  ImageFrame input;
  input.depth_m = image.depth_m;
  input.view = view_of(options_, frame, camera, grid_);
  const voxel_grid::PixelRules rules =
      voxel_grid::pixel_rules(grid_, options_.rules(), options_.clear_no_return, input.view.band_m);
  input.rules = {rules.min_range_sq, rules.max_range_m, rules.floor_top_vox, rules.band_m,
                 rules.clear_no_return};
  const voxel_grid::PixelRays rays(frame, camera, grid_);
  lines_.resize(static_cast<std::size_t>(camera.height_px));
  for (int v = 0; v < camera.height_px; ++v) {
    const voxel_grid::PixelRow row = rays.row(v);
    PixelLine& line = lines_[static_cast<std::size_t>(v)];
    line.y = row.y;
    std::ranges::copy(row.along_vox, line.along_vox);
    if (v > 0) continue;
    input.x_first = row.x_first;
    input.x_step = row.x_step;
    std::ranges::copy(row.start_vox, input.start_vox);
    std::ranges::copy(row.across_vox, input.across_vox);
  }
  input.lines = lines_;
  balls_.clear();
  for (const voxel_grid::CameraBall& seen : voxel_grid::balls_in_view(frame, camera, self_)) {
    Ball ball{{}, seen.radius_m, seen.u0, seen.v0, seen.u1, seen.v1};
    std::ranges::copy(seen.centre_m, ball.centre_m);
    balls_.push_back(ball);
  }
  input.balls = balls_;
  return map_->integrate(input);
}

Result<MapChange> VoxelGridCuda::cast_rays(const Frame& frame) {
  RayFrame input;
  if (const auto* image = std::get_if<DepthImage>(&frame.measurement)) {
    input.depth_m = image->depth_m;
    input.width_px = image->camera.width_px;
    input.fx_px = image->camera.fx_px;
    input.fy_px = image->camera.fy_px;
    input.cx_px = image->camera.cx_px;
    input.cy_px = image->camera.cy_px;
  } else {
    const auto& points_m = std::get_if<PointCloud>(&frame.measurement)->points_m;
    input.cloud = {reinterpret_cast<const CloudPoint*>(points_m.data()), points_m.size()};
  }
  const PointRules rules = options_.rules();
  input.limits = {rules.min_range_m, rules.max_range_m, rules.floor_top_m(),
                  options_.clear_no_return};
  for (int row = 0; row < 3; ++row) {
    for (int c = 0; c < 4; ++c) input.T_world_camera[row][c] = frame.T_world_camera(row, c);
  }
  input.origin_m = point(grid_.origin_m);
  input.camera_vox =
      point((frame.T_world_camera.translation() - grid_.origin_m) / grid_.resolution_m);
  input.resolution_m = grid_.resolution_m;
  world_balls_.clear();
  Eigen::Vector3d lower = Eigen::Vector3d::Constant(cuda::kInfinity);
  Eigen::Vector3d upper = -lower;
  for (const SelfFilter::Ball& ball : self_.balls()) {
    world_balls_.push_back({point(ball.centre_m), ball.radius_m});
    const Eigen::Vector3d reach = Eigen::Vector3d::Constant(ball.radius_m);
    lower = lower.cwiseMin(ball.centre_m - reach);
    upper = upper.cwiseMax(ball.centre_m + reach);
  }
  input.balls = world_balls_;
  input.balls_lower_m = point(lower);
  input.balls_upper_m = point(upper);
  return map_->integrate(input);
}

void VoxelGridCuda::take_over(const MapChange& change) {
  const Eigen::Vector3i counts = block_counts(grid_);
  const auto words = static_cast<std::size_t>(words_per_row_);
  // Rows of blocks along x share words: they are one thread's.
  std::vector<std::size_t> begins;
  for (std::size_t i = 0; i < change.blocks.size(); ++i) {
    if (i == 0 || change.blocks[i] / counts.x() != change.blocks[i - 1] / counts.x()) {
      begins.push_back(i);
    }
  }
  begins.push_back(change.blocks.size());
  context_.workers.run(static_cast<int>(begins.size()) - 1, [&](int part) {
    const auto p = static_cast<std::size_t>(part);
    for (std::size_t i = begins[p]; i < begins[p + 1]; ++i) {
      const std::int32_t block = change.blocks[i];
      const int bx = block % counts.x();
      const int first_y = block / counts.x() % counts.y() * kSide;
      const int first_z = block / (counts.x() * counts.y()) * kSide;
      const std::uint16_t* rows = change.rows.data() + 2 * i * cuda::kBlockRows;
      for (int row = 0; row < cuda::kBlockRows; ++row) {
        const int y = first_y + row % kSide;
        const int z = first_z + row / kSide;
        if (y >= grid_.size_vox.y() || z >= grid_.size_vox.z()) continue;
        const std::size_t line =
            static_cast<std::size_t>(y) +
            static_cast<std::size_t>(grid_.size_vox.y()) * static_cast<std::size_t>(z);
        const std::size_t word = line * words + static_cast<std::size_t>(bx / 4);
        set_row(occupied_[word], bx % 4 * kSide, rows[row]);
        set_row(known_[word], bx % 4 * kSide, rows[cuda::kBlockRows + row]);
      }
    }
  });
}

Result<MapUpdate> VoxelGridCuda::begin_anew(const Frame& frame, const Error& why) {
  context_.log.warn("mapper voxel_grid_cuda begins anew as voxel_grid, on the CPU: " +
                    why.describe());
  map_.reset();
  cpu_ = std::make_unique<voxel_grid::VoxelGrid>(options_, context_);
  auto update = SIDESTEP_TRY(cpu_->integrate(frame));
  update.sequence = ++sequence_;
  update.grid_moved = true;
  update.changed_blocks.resize(static_cast<std::size_t>(block_counts(grid_).prod()));
  std::iota(update.changed_blocks.begin(), update.changed_blocks.end(), 0);
  return update;
}

Result<std::unique_ptr<Mapper>> create(const Options& options, const HostContext& context,
                                       const MakeMap& make) {
  auto map = make(settings_of(options));
  if (map) return std::make_unique<VoxelGridCuda>(options, context, std::move(*map));
  if (options.fallback != "cpu") return tl::make_unexpected(unusable(std::move(map.error())));
  context.log.warn("mapper voxel_grid_cuda runs as voxel_grid, on the CPU: " +
                   map.error().describe());
  return voxel_grid::create(options, context);
}

}  // namespace sidestep::voxel_grid_cuda
