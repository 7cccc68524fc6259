#include "esdf_field.hpp"

#include <algorithm>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include <sidestep/mapping/dense_field_publisher.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/tsdf_view.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "distance_waves.hpp"

namespace sidestep::esdf {
namespace {

Unknown unknown_of(const std::string& name) {
  if (name == "occupied") return Unknown::kOccupied;
  return name == "ignored" ? Unknown::kIgnored : Unknown::kFree;
}

class EsdfBuilder final : public FieldBuilder {
 public:
  EsdfBuilder(Options options, WorkerPool& workers)
      : options_(std::move(options)), workers_(workers) {}

  Result<void> attach(Mapper& mapper) override {
    const auto* tsdf = dynamic_cast<const TsdfView*>(&mapper);
    const auto* occupancy = dynamic_cast<const OccupancyView*>(&mapper);
    if (tsdf == nullptr || occupancy == nullptr) {
      return fail(
          ErrorCode::kUnsupported,
          tsdf == nullptr ? "the mapper offers no TsdfView" : "the mapper offers no OccupancyView",
          "field esdf", "the mapper tsdf offers it");
    }
    const GridSpec& grid = tsdf->tsdf_grid();
    SIDESTEP_TRY(check(*tsdf));
    waves_.emplace(
        WaveSettings{.grid = grid,
                     .max_distance_m = static_cast<float>(options_.max_distance_m),
                     .band_m = static_cast<float>(options_.fixed_band_vox * grid.resolution_m),
                     .min_change_m = static_cast<float>(options_.min_change_m),
                     .unknown = unknown_of(options_.unknown),
                     .full_euclidean = options_.propagation == "full_euclidean"},
        workers_);
    publisher_.emplace(FieldInfo{.grid = grid,
                                 .is_signed = options_.is_signed,
                                 .max_distance_m = options_.max_distance_m},
                       *occupancy, workers_);
    tsdf_ = tsdf;
    first_ = true;
    return {};
  }

  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate& update) override {
    if (tsdf_ == nullptr) {
      return fail(ErrorCode::kInvalidArgument, "update() before attach()", "field esdf");
    }
    auto changed = SIDESTEP_TRY(publisher_->begin(update));
    if (std::exchange(first_, false)) {
      std::vector<std::int32_t> all(changed.size());
      std::iota(all.begin(), all.end(), 0);
      waves_->update(*tsdf_, all);
    } else {
      waves_->update(*tsdf_, tsdf_->tsdf_changed_blocks());
      std::ranges::fill(changed, std::uint8_t{0});  // the waves know better
    }
    waves_->flag_changed(changed);
    const float least_m = options_.is_signed ? -std::numeric_limits<float>::infinity() : 0.0F;
    return publisher_->publish(update, changed,
                               [&](int x, int y, int z, int count, float* distances_m) {
                                 waves_->row(x, y, z, count, distances_m);
                                 for (int i = 0; i < count; ++i)
                                   distances_m[i] = std::max(least_m, distances_m[i]);
                               });
  }

 private:
  [[nodiscard]] Result<void> check(const TsdfView& tsdf) const {
    const GridSpec& grid = tsdf.tsdf_grid();
    const double band_m = options_.fixed_band_vox * grid.resolution_m;
    if (band_m > tsdf.truncation_m() * (1.0 + 1e-6) || band_m > options_.max_distance_m) {
      return fail(ErrorCode::kUnsupported,
                  "fixed_band_vox is more than the TSDF's truncation distance or max_distance_m",
                  "field esdf", "lower fixed_band_vox, or raise the mapper's truncation_vox");
    }
    if (!DistanceWaves::fits(grid, options_.max_distance_m)) {
      return fail(ErrorCode::kUnsupported, "the grid has too many voxels", "field esdf",
                  "choose a smaller size_vox or a larger resolution_m");
    }
    return {};
  }

  Options options_;
  WorkerPool& workers_;
  const TsdfView* tsdf_ = nullptr;
  bool first_ = true;
  std::optional<DistanceWaves> waves_;
  std::optional<DenseFieldPublisher> publisher_;
};

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext& context) {
  return make_esdf_builder(options, context.workers);
}

}  // namespace

std::unique_ptr<FieldBuilder> make_esdf_builder(const Options& options, WorkerPool& workers) {
  return std::make_unique<EsdfBuilder>(options, workers);
}

}  // namespace sidestep::esdf

SIDESTEP_PLUGIN(sidestep::FieldBuilder, sidestep::esdf::Options, sidestep::esdf::create, "esdf",
                "0.1.0", "Signed distances spread from a TSDF by wavefronts, as in Voxblox",
                sidestep::TsdfView, sidestep::OccupancyView)
