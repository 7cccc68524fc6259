#include "integrators.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace sidestep::voxel_grid {
namespace {

constexpr int kRaysAtOnce = 64;
constexpr std::size_t kPointsAtOnce = 2048;

}  // namespace

RaycastIntegrator::RaycastIntegrator(const VoxelGridOptions& options, LogOddsGrid& map,
                                     VoxelMarks& hits, WorkerPool& workers)
    : map_(map),
      hits_(hits),
      workers_(workers),
      rules_(options.rules()),
      clear_no_return_(options.clear_no_return),
      misses_(options.grid()),
      free_ends_(options.grid()) {}

IntegrationCounts RaycastIntegrator::integrate(const Frame& frame, const SelfFilter& self) {
  const RayEnds ends(map_.spec(), rules_, clear_no_return_, self, frame);
  const std::size_t chunks = (ends.size() + kPointsAtOnce - 1) / kPointsAtOnce;
  std::vector<IntegrationCounts> counts(chunks);
  workers_.run(static_cast<int>(chunks), [&](int chunk) {
    const std::size_t begin = static_cast<std::size_t>(chunk) * kPointsAtOnce;
    counts[static_cast<std::size_t>(chunk)] =
        mark_ends(ends, begin, std::min(begin + kPointsAtOnce, ends.size()));
  });
  gather_rays();
  const Eigen::Vector3d camera_vox = ends.camera_vox();
  workers_.run_banded(static_cast<int>(rays_.size()), kRaysAtOnce, [&](int begin, int end) {
    for (int r = begin; r < end; ++r) walk(camera_vox, rays_[static_cast<std::size_t>(r)]);
  });
  update_map(frame.stamp.seconds());
  IntegrationCounts all;
  for (const IntegrationCounts& part : counts) add_counts(all, part);
  return all;
}

IntegrationCounts RaycastIntegrator::mark_ends(const RayEnds& ends, std::size_t begin,
                                               std::size_t end) {
  IntegrationCounts counts;
  for (std::size_t index = begin; index < end; ++index) {
    const auto ray = ends.at(index, counts);
    if (!ray) continue;
    const Eigen::Vector3i voxel = nearest_voxel(map_.spec(), ray->p_vox);
    (ray->hit ? hits_ : free_ends_).insert(voxel.x(), voxel.y(), voxel.z());
  }
  return counts;
}

void RaycastIntegrator::gather_rays() {
  rays_.clear();
  const Eigen::Vector3i& counts = map_.counts();
  for (std::int32_t linear = 0; linear < map_.block_count(); ++linear) {
    if (!hits_.in_block(linear) && !free_ends_.in_block(linear)) continue;
    const int row = linear / counts.x();
    gather_block({linear % counts.x(), row % counts.y(), row / counts.y()});
  }
}

void RaycastIntegrator::gather_block(const Eigen::Vector3i& block) {
  const Eigen::Vector3i first = block * kBlockSide_vox;
  const Eigen::Vector3i end =
      (first + Eigen::Vector3i::Constant(kBlockSide_vox)).cwiseMin(map_.spec().size_vox);
  for (int z = first.z(); z < end.z(); ++z) {
    for (int y = first.y(); y < end.y(); ++y) {
      const std::size_t row = map_.row(y, z);
      const unsigned free = free_ends_.take_row(row, block.x());
      for (unsigned bits = free | hits_.row(row, block.x()); bits != 0; bits &= bits - 1) {
        const int lane = std::countr_zero(bits);
        rays_.push_back({{first.x() + lane, y, z}, ((free >> lane) & 1U) != 0});
      }
    }
  }
  free_ends_.leave_block(block_linear(block, map_.counts()));
}

void RaycastIntegrator::walk(const Eigen::Vector3d& camera_vox, const Ray& ray) {
  const Eigen::Vector3d to = ray.end.cast<double>() + Eigen::Vector3d::Constant(0.5);
  const auto part = clip_to_box(camera_vox, to, map_.spec().size_vox.cast<double>());
  if (!part) return;
  const Eigen::Vector3d along = to - camera_vox;
  Eigen::Vector3i voxel = nearest_voxel(map_.spec(), camera_vox + part->enter * along);
  Eigen::Vector3i step;
  Eigen::Vector3d next;   // parameter at which the ray leaves the voxel along each axis
  Eigen::Vector3d delta;  // parameter from one plane of voxels to the next
  for (int axis = 0; axis < 3; ++axis) {
    step[axis] = ray.end[axis] > voxel[axis] ? 1 : -1;
    delta[axis] = 1.0 / std::abs(along[axis]);
    const double plane = voxel[axis] + (step[axis] > 0 ? 1.0 : 0.0);
    // An axis that has arrived is left alone: the walk always ends in the ray's end voxel.
    next[axis] = ray.end[axis] == voxel[axis] ? std::numeric_limits<double>::infinity()
                                              : (plane - camera_vox[axis]) / along[axis];
  }
  while (voxel != ray.end) {
    misses_.insert(voxel.x(), voxel.y(), voxel.z());
    int axis = next.x() < next.y() ? 0 : 1;
    if (next.z() < next[axis]) axis = 2;
    voxel[axis] += step[axis];
    next[axis] = voxel[axis] == ray.end[axis] ? std::numeric_limits<double>::infinity()
                                              : next[axis] + delta[axis];
  }
  if (ray.end_is_free) misses_.insert(voxel.x(), voxel.y(), voxel.z());
}

void RaycastIntegrator::update_map(double stamp_s) {
  for_each_block(map_, workers_, [&](int, const Eigen::Vector3i& block) {
    const std::int32_t linear = block_linear(block, map_.counts());
    if (!hits_.in_block(linear) && !misses_.in_block(linear)) return;
    const BlockRows rows = block_rows(map_, block);
    std::uint16_t hits[kBlockRows];
    std::uint16_t misses[kBlockRows];
    take_marks(hits_, map_, block, rows, hits);
    take_marks(misses_, map_, block, rows, misses);
    note(map_, block, stamp_s, integrate_marked(map_.model(), rows, hits, misses));
  });
}

}  // namespace sidestep::voxel_grid
