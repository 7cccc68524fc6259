#include "raycast.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>

#include "block_rows.hpp"
#include "counts.hpp"

namespace sidestep::voxel_grid {
namespace {

constexpr int kRaysAtOnce = 64;
constexpr int kPointsAtOnce = 2048;

/// The part [enter, leave] of from + t * (to - from), 0 <= t <= 1, inside the box [0, upper].
struct Clip {
  double enter;
  double leave;
};
std::optional<Clip> clip(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                         const Eigen::Vector3d& upper) {
  Clip part{0.0, 1.0};
  for (int axis = 0; axis < 3; ++axis) {
    const double along = to[axis] - from[axis];
    if (along == 0.0) {
      if (from[axis] < 0.0 || from[axis] >= upper[axis]) return std::nullopt;
      continue;
    }
    const double a = (0.0 - from[axis]) / along;
    const double b = (upper[axis] - from[axis]) / along;
    part.enter = std::max(part.enter, std::min(a, b));
    part.leave = std::min(part.leave, std::max(a, b));
  }
  if (part.enter >= part.leave) return std::nullopt;
  return part;
}

Eigen::Vector3i voxel_of(const Eigen::Vector3d& p_vox, const Eigen::Vector3i& size_vox) {
  return p_vox.array().floor().cast<int>().max(0).min(size_vox.array() - 1).matrix();
}

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
  const auto* image = std::get_if<DepthImage>(&frame.measurement);
  const IntegrationCounts counts =
      image != nullptr ? add_image(frame, *image, self)
                       : add_cloud(frame, std::get<PointCloud>(frame.measurement), self);
  gather_rays();
  const Eigen::Vector3d camera_vox =
      (frame.T_world_camera.translation() - map_.spec().origin_m) / map_.spec().resolution_m;
  workers_.run_banded(static_cast<int>(rays_.size()), kRaysAtOnce, [&](int begin, int end) {
    for (int r = begin; r < end; ++r) walk(camera_vox, rays_[static_cast<std::size_t>(r)]);
  });
  update_map();
  return counts;
}

IntegrationCounts RaycastIntegrator::add_image(const Frame& frame, const DepthImage& image,
                                               const SelfFilter& self) {
  const CameraIntrinsics& camera = image.camera;
  std::vector<IntegrationCounts> counts(static_cast<std::size_t>(camera.height_px));
  workers_.run(camera.height_px, [&](int v) {
    IntegrationCounts row;
    for (int u = 0; u < camera.width_px; ++u) {
      const float depth_m = image.at(u, v);
      if (depth_m > 0.0F) {
        add_point(frame, self, camera.unproject(u, v, static_cast<double>(depth_m)), row);
        continue;
      }
      ++row.invalid;
      if (!clear_no_return_ || depth_m != 0.0F) continue;
      const Eigen::Vector3d ray = camera.unproject(u, v, 1.0);
      add_free(frame.T_world_camera.translation(),
               frame.T_world_camera * Eigen::Vector3d(ray.normalized() * rules_.max_range_m));
    }
    counts[static_cast<std::size_t>(v)] = row;
  });
  return sum(counts);
}

IntegrationCounts RaycastIntegrator::add_cloud(const Frame& frame, const PointCloud& cloud,
                                               const SelfFilter& self) {
  const std::size_t size = cloud.points_m.size();
  const std::size_t chunks = (size + kPointsAtOnce - 1) / kPointsAtOnce;
  std::vector<IntegrationCounts> counts(chunks);
  workers_.run(static_cast<int>(chunks), [&](int chunk) {
    const std::size_t begin = static_cast<std::size_t>(chunk) * kPointsAtOnce;
    const std::size_t end = std::min(begin + kPointsAtOnce, size);
    IntegrationCounts part;
    for (std::size_t p = begin; p < end; ++p) {
      add_point(frame, self, cloud.points_m[p].cast<double>(), part);
    }
    counts[static_cast<std::size_t>(chunk)] = part;
  });
  return sum(counts);
}

void RaycastIntegrator::add_point(const Frame& frame, const SelfFilter& self,
                                  const Eigen::Vector3d& p_camera, IntegrationCounts& counts) {
  const Eigen::Vector3d p_world = frame.T_world_camera * p_camera;
  const PointFate fate = rules_.fate(p_camera, p_world);
  if (fate == PointFate::kInvalid) {
    ++counts.invalid;
    return;
  }
  ++counts.points;
  if (self.contains(p_world)) {
    ++counts.self;
    return;
  }
  const Eigen::Vector3d& from_world = frame.T_world_camera.translation();
  if (fate == PointFate::kFloor) {
    ++counts.floor;
    add_free(from_world, p_world);
  } else if (fate == PointFate::kOutOfRange) {
    ++counts.out_of_range;
    const double share = rules_.max_range_m / p_camera.norm();
    add_free(from_world, from_world + share * (p_world - from_world));
  } else {
    const Eigen::Vector3d p_vox = (p_world - map_.spec().origin_m) / map_.spec().resolution_m;
    if ((p_vox.array() >= 0.0).all() &&
        (p_vox.array() < map_.spec().size_vox.cast<double>().array()).all()) {
      ++counts.inserted;
      const Eigen::Vector3i voxel = p_vox.cast<int>();
      hits_.insert(voxel.x(), voxel.y(), voxel.z());
    } else {
      ++counts.outside_grid;
      add_free(from_world, p_world);
    }
  }
}

void RaycastIntegrator::add_free(const Eigen::Vector3d& from_world,
                                 const Eigen::Vector3d& to_world) {
  const GridSpec& grid = map_.spec();
  const Eigen::Vector3d from = (from_world - grid.origin_m) / grid.resolution_m;
  const Eigen::Vector3d to = (to_world - grid.origin_m) / grid.resolution_m;
  const auto part = clip(from, to, grid.size_vox.cast<double>());
  if (!part) return;
  const Eigen::Vector3i last = voxel_of(from + part->leave * (to - from), grid.size_vox);
  free_ends_.insert(last.x(), last.y(), last.z());
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
  const Eigen::Vector3i& size = map_.spec().size_vox;
  const Eigen::Vector3d to = ray.end.cast<double>() + Eigen::Vector3d::Constant(0.5);
  const auto part = clip(camera_vox, to, size.cast<double>());
  if (!part) return;
  const Eigen::Vector3d along = to - camera_vox;
  Eigen::Vector3i voxel = voxel_of(camera_vox + part->enter * along, size);
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

void RaycastIntegrator::update_map() {
  const Eigen::Vector3i& counts = map_.counts();
  workers_.run(counts.y() * counts.z(), [&](int row) {
    Eigen::Vector3i block(0, row % counts.y(), row / counts.y());
    for (block.x() = 0; block.x() < counts.x(); ++block.x()) {
      const std::int32_t linear = block_linear(block, counts);
      if (!hits_.in_block(linear) && !misses_.in_block(linear)) continue;
      const BlockRows rows = block_rows(map_, block);
      std::uint16_t hits[kBlockRows];
      std::uint16_t misses[kBlockRows];
      take_marks(hits_, map_, block, rows, hits);
      take_marks(misses_, map_, block, rows, misses);
      note(map_, block, integrate_marked(map_.model(), rows, hits, misses));
    }
  });
}

}  // namespace sidestep::voxel_grid
