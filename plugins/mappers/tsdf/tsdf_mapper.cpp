#include "tsdf_mapper.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include <sidestep/mapping/frame_check.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/tsdf_view.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::tsdf {
namespace {

/// A frame is always divided into so many parts, whatever the number of threads, because rays
/// of the fast integrator know only of those in their own part.
constexpr std::size_t kParts = 16;
/// Rays of the other integrators that are walked before their voxels are updated: bounds the
/// memory for what they cross.
constexpr std::size_t kRaysAtOnce = 32768;

/// Visits 0 .. size - 1 in steps of about the golden section of it: the first few already lie
/// everywhere, as rays of the fast integrator should that keep others from being cast. Each turn
/// begins elsewhere, so that voxels between the rays of one frame are met in another.
class ScatteredOrder {
 public:
  ScatteredOrder(std::size_t size, std::int64_t turn) : size_(size) {
    constexpr std::size_t kTurnStep = 7919;
    step_ = std::max<std::size_t>(1, size * 618 / 1000);
    while (std::gcd(step_, size_) > 1) ++step_;
    if (size > 0) at_ = static_cast<std::size_t>(turn) * kTurnStep % size;
  }
  [[nodiscard]] std::size_t next() noexcept {
    const std::size_t at = at_;
    at_ += step_;
    if (at_ >= size_) at_ -= size_;
    return at;
  }

 private:
  std::size_t size_;
  std::size_t step_;
  std::size_t at_ = 0;
};

void add_ray(const std::optional<Ray>& ray, Trace& trace) {
  if (ray) trace.rays.push_back(*ray);
}

}  // namespace

Parameters<TsdfOptions> TsdfOptions::parameters() {
  using O = TsdfOptions;
  return declare_measurement(std::move(
      declare_grid(Parameters<O>())
          .add("integrator", &O::integrator,
               "simple: a ray for each point; merged: one for all points of a voxel; fast: rays "
               "that "
               "bring little new are left out or cut short.",
               {.choices = {"simple", "merged", "fast"}})
          .add("truncation_vox", &O::truncation_vox,
               "Distances are cut off here; rays reach this far behind the surface.",
               {.unit = "vox", .min = 2.0, .max = 100.0})
          .add("weighting", &O::weighting,
               "Weight of a point: 1, or 1/z^2 with its depth z in metres, as the noise of a depth "
               "camera grows.",
               {.choices = {"constant", "inverse_square"}})
          .add("weight_dropoff", &O::weight_dropoff,
               "Whether weights fall linearly to 0 from one voxel behind the surface to the "
               "truncation distance.")
          .add("max_weight", &O::max_weight,
               "Weights stop growing here; the smaller, the faster the map follows change.",
               {.min = 0.0})
          .add("carving", &O::carving,
               "Whether rays start at the camera; otherwise a truncation distance before the "
               "surface.")
          .add("start_cells_per_voxel", &O::start_cells_per_voxel,
               "fast: one ray for each cell that holds points, this many cells along a voxel's "
               "edge.",
               {.min = 1, .max = 4})
          .add("max_consecutive_collisions", &O::max_consecutive_collisions,
               "fast: a ray stops after more than this many voxels in a row that others have seen.",
               {.min = 0})));
}

std::vector<OptionMistake> TsdfOptions::check() const {
  // What is allocated at once, two bitsets; blocks of distances follow what is seen.
  const double bitsets_mib = voxels_of_blocks(*this) / 4.0 / (1 << 20);
  std::vector<OptionMistake> mistakes = check_map_options(*this, bitsets_mib);
  if (!(max_weight > 0.0)) mistakes.push_back({{"max_weight"}, "must be above 0", {}});
  return mistakes;
}

TsdfMapper::TsdfMapper(const TsdfOptions& options, const HostContext& context)
    : options_(options),
      rules_(options.rules()),
      workers_(context.workers),
      self_(context.robot, options.self_filter_margin_m),
      map_(options, context.workers),
      bundler_(options.grid()),
      traces_(kParts),
      walkers_(kParts, RayWalker(options)) {
  if (options.integrator == "fast") starts_.assign(kParts, StartCells(options));
}

Result<MapUpdate> TsdfMapper::integrate(const Frame& frame) {
  SIDESTEP_TRY(check_frame(frame));
  SIDESTEP_TRY(self_.pose(frame));
  const RayEnds ends(map_.grid(), rules_, options_.clear_no_return, self_, frame);
  const RayMaker maker(options_, ends, frame);
  map_.begin_frame();
  MapUpdate update;
  if (options_.integrator == "fast") {
    update.counts = integrate_fast(ends, maker);
  } else if (options_.integrator == "merged") {
    update.counts = integrate_merged(ends, maker);
  } else {
    update.counts = integrate_simple(ends, maker);
  }
  changed_ = map_.changed_distances();
  update.sequence = ++sequence_;
  update.stamp = frame.stamp;
  update.changed_blocks = map_.changed_occupancy();
  return update;
}

template <class Make>
IntegrationCounts TsdfMapper::in_parts(std::size_t begin, std::size_t end, const Make& make) {
  std::array<IntegrationCounts, kParts> counts;
  workers_.run(static_cast<int>(kParts), [&](int p) {
    const auto part = static_cast<std::size_t>(p);
    const std::size_t from = begin + (end - begin) * part / kParts;
    const std::size_t to = begin + (end - begin) * (part + 1) / kParts;
    make(from, to, part, counts[part]);
  });
  IntegrationCounts all;
  for (const IntegrationCounts& part : counts) add_counts(all, part);
  return all;
}

IntegrationCounts TsdfMapper::integrate_fast(const RayEnds& ends, const RayMaker& maker) {
  const IntegrationCounts counts =
      in_parts(0, ends.size(),
               [&](std::size_t from, std::size_t to, std::size_t part, IntegrationCounts& counted) {
                 ScatteredOrder order(to - from, sequence_);
                 traces_[part].clear();
                 for (std::size_t i = from; i < to; ++i) {
                   const auto end = maker.end(from + order.next(), counted);
                   if (end && starts_[part].insert(*end)) add_ray(maker.to(*end), traces_[part]);
                 }
                 starts_[part].clear();
               });
  walk_and_integrate(ends.camera_vox());
  return counts;
}

IntegrationCounts TsdfMapper::make_all_rays(const RayMaker& maker, std::size_t begin,
                                            std::size_t end) {
  return in_parts(
      begin, end,
      [&](std::size_t from, std::size_t to, std::size_t part, IntegrationCounts& counted) {
        traces_[part].clear();
        for (std::size_t i = from; i < to; ++i) {
          if (const auto at = maker.end(i, counted)) add_ray(maker.to(*at), traces_[part]);
        }
      });
}

IntegrationCounts TsdfMapper::integrate_simple(const RayEnds& ends, const RayMaker& maker) {
  IntegrationCounts all;
  for (std::size_t begin = 0; begin < ends.size(); begin += kRaysAtOnce) {
    add_counts(all, make_all_rays(maker, begin, std::min(begin + kRaysAtOnce, ends.size())));
    walk_and_integrate(ends.camera_vox());
  }
  return all;
}

IntegrationCounts TsdfMapper::integrate_merged(const RayEnds& ends, const RayMaker& maker) {
  const IntegrationCounts counts = make_all_rays(maker, 0, ends.size());
  for (const Trace& trace : traces_) {
    for (const Ray& ray : trace.rays) bundler_.add(ray);
  }
  const std::vector<Ray> bundles = bundler_.take(maker);
  for (std::size_t begin = 0; begin < bundles.size(); begin += kRaysAtOnce) {
    const std::size_t size = std::min(kRaysAtOnce, bundles.size() - begin);
    for (std::size_t part = 0; part < kParts; ++part) {
      traces_[part].clear();
      const auto from = bundles.begin() + static_cast<std::ptrdiff_t>(begin);
      traces_[part].rays.assign(from + static_cast<std::ptrdiff_t>(size * part / kParts),
                                from + static_cast<std::ptrdiff_t>(size * (part + 1) / kParts));
    }
    walk_and_integrate(ends.camera_vox());
  }
  return counts;
}

void TsdfMapper::walk_and_integrate(const Eigen::Vector3d& camera_vox) {
  workers_.run(static_cast<int>(kParts), [&](int part) {
    walkers_[static_cast<std::size_t>(part)].walk_all(camera_vox,
                                                      traces_[static_cast<std::size_t>(part)]);
  });
  map_.integrate(traces_, camera_vox);
}

Result<std::unique_ptr<Mapper>> create(const TsdfOptions& options, const HostContext& context) {
  return std::make_unique<TsdfMapper>(options, context);
}

}  // namespace sidestep::tsdf

SIDESTEP_PLUGIN(sidestep::Mapper, sidestep::tsdf::TsdfOptions, sidestep::tsdf::create, "tsdf",
                "0.1.0", "Truncated signed distances along rays in blocks, as in Voxblox",
                sidestep::TsdfView, sidestep::OccupancyView)
