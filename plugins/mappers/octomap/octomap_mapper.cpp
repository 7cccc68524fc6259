#include "octomap_mapper.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <sidestep/mapping/frame_check.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/octree_view.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::octomap_mapper {
namespace {

/// OctoMap's keys are 16 bits, with the world's origin in the middle.
constexpr double kKeysEachWay = 32768.0;
constexpr double kAlignment_vox = 1e-4;

std::string text(double value) { return detail::number_text(value); }

using Mistakes = std::vector<OptionMistake>;

/// Whether the grid's voxels are leaves that an OctoMap can have.
void check_alignment(const OctomapOptions& options, Mistakes& mistakes) {
  bool reaches_beyond = false;
  for (int axis = 0; axis < 3; ++axis) {
    const double first = options.origin_m[axis] / options.resolution_m;
    if (std::abs(first - std::round(first)) > kAlignment_vox) {
      mistakes.push_back({{"origin_m[" + std::to_string(axis) + "]", "resolution_m"},
                          "must be a multiple of resolution_m, as OctoMap's voxels are; " +
                              text(options.origin_m[axis]) + " is not",
                          "use " + text(std::round(first) * options.resolution_m)});
    }
    reaches_beyond |= first < -kKeysEachWay || first + options.size_vox[axis] > kKeysEachWay;
  }
  if (reaches_beyond) {
    mistakes.push_back({{"size_vox", "origin_m"},
                        "and origin_m reach beyond 32768 voxels from the world's origin, where "
                        "OctoMap ends",
                        {}});
  }
}

void check_model(const OctomapOptions& options, Mistakes& mistakes) {
  if (!(options.prob_hit > 0.5 && options.prob_hit < 1.0)) {
    mistakes.push_back(
        {{"prob_hit"}, "must be above 0.5 and below 1, not " + text(options.prob_hit), {}});
  }
  if (!(options.prob_miss > 0.0 && options.prob_miss < 0.5)) {
    mistakes.push_back(
        {{"prob_miss"}, "must be above 0 and below 0.5, not " + text(options.prob_miss), {}});
  }
  if (!(0.0 < options.clamp_min && options.clamp_min < options.clamp_max &&
        options.clamp_max < 1.0)) {
    mistakes.push_back({{"clamp_min", "clamp_max"},
                        "must be above 0 and below clamp_max, and that below 1; they are " +
                            text(options.clamp_min) + " and " + text(options.clamp_max),
                        {}});
  } else if (!(options.occupied_at > options.clamp_min &&
               options.occupied_at <= options.clamp_max)) {
    mistakes.push_back(
        {{"occupied_at", "clamp_min", "clamp_max"},
         "must be above clamp_min and at most clamp_max, or no voxel ever changes; " +
             text(options.occupied_at) + " is not",
         {}});
  }
}

}  // namespace

Parameters<OctomapOptions> OctomapOptions::parameters() {
  using O = OctomapOptions;
  return declare_measurement(std::move(
      declare_grid(Parameters<O>())
          .add("prob_hit", &O::prob_hit, "Probability of occupancy given a hit.",
               {.min = 0.5, .max = 1.0})
          .add("prob_miss", &O::prob_miss, "Probability of occupancy given a ray passing through.",
               {.min = 0.0, .max = 0.5})
          .add("clamp_min", &O::clamp_min, "Lower clamp of the probability.",
               {.min = 0.0, .max = 1.0})
          .add("clamp_max", &O::clamp_max, "Upper clamp of the probability.",
               {.min = 0.0, .max = 1.0})
          .add("occupied_at", &O::occupied_at, "A voxel is occupied from this probability on.",
               {.min = 0.0, .max = 1.0})));
}

std::vector<OptionMistake> OctomapOptions::check() const {
  // What is allocated at once, two bitsets; the tree follows what is seen.
  const double bitsets_mib = voxels_of_blocks(*this) / 4.0 / (1 << 20);
  Mistakes mistakes = check_map_options(*this, bitsets_mib);
  check_alignment(*this, mistakes);
  check_model(*this, mistakes);
  return mistakes;
}

OctomapMapper::OctomapMapper(const OctomapOptions& options, const HostContext& context)
    : grid_(options.grid()),
      rules_(options.rules()),
      clear_no_return_(options.clear_no_return),
      self_(context.robot, options.self_filter_margin_m),
      tree_(options.resolution_m),
      words_per_row_((options.size_vox.x() + 63) / 64) {
  tree_.setProbHit(options.prob_hit);
  tree_.setProbMiss(options.prob_miss);
  tree_.setClampingThresMin(options.clamp_min);
  tree_.setClampingThresMax(options.clamp_max);
  tree_.setOccupancyThres(options.occupied_at);
  tree_.enableChangeDetection(true);
  octomap::point3d lower = centre(Eigen::Vector3i::Zero());
  octomap::point3d upper = centre(grid_.size_vox - Eigen::Vector3i::Ones());
  tree_.setBBXMin(lower);
  tree_.setBBXMax(upper);
  tree_.useBBXLimit(true);
  first_key_ = tree_.coordToKey(lower);
  const std::size_t words = static_cast<std::size_t>(words_per_row_) *
                            static_cast<std::size_t>(grid_.size_vox.y()) *
                            static_cast<std::size_t>(grid_.size_vox.z());
  occupied_.resize(words);
  known_.resize(words);
}

octomap::point3d OctomapMapper::centre(const Eigen::Vector3i& voxel) const {
  const Eigen::Vector3f p = grid_.centre_m(voxel).cast<float>();
  return {p.x(), p.y(), p.z()};
}

Result<MapUpdate> OctomapMapper::integrate(const Frame& frame) {
  SIDESTEP_TRY(check_frame(frame));
  SIDESTEP_TRY(self_.pose(frame));
  tree_.resetChangeDetection();  // the changes of this frame stay in place: see OctreeView
  MapUpdate update;
  update.counts = insert(frame);
  update.changed_blocks = apply_changes();
  update.sequence = ++sequence_;
  update.stamp = frame.stamp;
  return update;
}

IntegrationCounts OctomapMapper::insert(const Frame& frame) {
  const RayEnds ends(grid_, rules_, clear_no_return_, self_, frame);
  octomap::Pointcloud hits;
  octomap::Pointcloud free_ends;
  IntegrationCounts counts;
  // Neighbouring pixels often end in one voxel, which takes one ray anyway.
  std::optional<std::pair<bool, Eigen::Vector3i>> last;
  for (std::size_t index = 0; index < ends.size(); ++index) {
    const auto end = ends.at(index, counts);
    if (!end) continue;
    const std::pair<bool, Eigen::Vector3i> ray(end->hit, nearest_voxel(grid_, end->p_vox));
    if (last == ray) continue;
    last = ray;
    (end->hit ? hits : free_ends).push_back(centre(ray.second));
  }
  const Eigen::Vector3f camera = frame.T_world_camera.translation().cast<float>();
  update_nodes(hits, free_ends, {camera.x(), camera.y(), camera.z()});
  return counts;
}

void OctomapMapper::update_nodes(const octomap::Pointcloud& hits,
                                 const octomap::Pointcloud& free_ends,
                                 const octomap::point3d& camera) {
  // What insertPointCloud() does with discretize set, and the rays whose end is free as well.
  octomap::KeySet free;
  octomap::KeySet occupied;
  octomap::KeySet ends;
  tree_.computeDiscreteUpdate(hits, camera, free, occupied, -1.0);
  tree_.computeDiscreteUpdate(free_ends, camera, free, ends, -1.0);
  free.insert(ends.begin(), ends.end());
  for (const octomap::OcTreeKey& key : free) {
    if (occupied.count(key) == 0) tree_.updateNode(key, false);
  }
  for (const octomap::OcTreeKey& key : occupied) tree_.updateNode(key, true);
}

std::vector<std::int32_t> OctomapMapper::apply_changes() {
  const Eigen::Vector3i counts = block_counts(grid_);
  std::vector<std::int32_t> blocks;
  for (auto change = tree_.changedKeysBegin(); change != tree_.changedKeysEnd(); ++change) {
    const octomap::OcTreeKey& key = change->first;
    const Eigen::Vector3i voxel(key[0] - first_key_[0], key[1] - first_key_[1],
                                key[2] - first_key_[2]);
    const std::size_t row =
        static_cast<std::size_t>(voxel.y()) +
        static_cast<std::size_t>(grid_.size_vox.y()) * static_cast<std::size_t>(voxel.z());
    const std::size_t word =
        row * static_cast<std::size_t>(words_per_row_) + static_cast<std::size_t>(voxel.x()) / 64;
    const std::uint64_t bit = std::uint64_t{1} << (static_cast<unsigned>(voxel.x()) % 64U);
    const bool occupied = tree_.isNodeOccupied(tree_.search(key));
    known_[word] |= bit;
    occupied_[word] = occupied ? occupied_[word] | bit : occupied_[word] & ~bit;
    blocks.push_back(block_linear(voxel / kBlockSide_vox, counts));
  }
  std::sort(blocks.begin(), blocks.end());
  blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
  return blocks;
}

Result<std::unique_ptr<Mapper>> create(const OctomapOptions& options, const HostContext& context) {
  return std::make_unique<OctomapMapper>(options, context);
}

}  // namespace sidestep::octomap_mapper

SIDESTEP_PLUGIN(sidestep::Mapper, sidestep::octomap_mapper::OctomapOptions,
                sidestep::octomap_mapper::create, "octomap", "0.1.0",
                "Probabilistic octree of the OctoMap library, within a bounding grid",
                sidestep::OccupancyView, sidestep::OctreeView)
