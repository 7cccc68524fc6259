#include "octomap_mapper.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include <sidestep/mapping/frame_check.hpp>

namespace sidestep::octomap_mapper {

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
