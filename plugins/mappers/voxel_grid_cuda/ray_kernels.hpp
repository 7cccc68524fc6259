#pragma once

#include <cmath>
#include <cstdint>

#include "image_kernels.hpp"

/// Ray casting: points that end in the same voxel share one ray, to its centre (Amanatides and Woo
/// 1987), in double precision and in the order of arithmetic of the mapper voxel_grid.
namespace sidestep::voxel_grid_cuda {

struct Point {
  double x = 0.0, y = 0.0, z = 0.0;

  [[nodiscard]] SIDESTEP_HOST_DEVICE double at(int axis) const {
    return axis == 0 ? x : axis == 1 ? y : z;
  }
};

/// A ball of the robot in the world.
struct WorldBall {
  Point centre_m;
  double radius_m = 0.0;
};

struct CloudPoint {
  float x, y, z;
};

struct PointLimits {
  double min_range_m = 0.0;
  double max_range_m = 0.0;
  double floor_top_m = 0.0;
  bool clear_no_return = false;
};

/// The share of a line that lies in the grid; none where leave <= enter.
struct Share {
  double enter = 0.0;
  double leave = 1.0;
};
SIDESTEP_HOST_DEVICE inline Share clip(const Point& from, const Point& to,
                                       const cuda::Extent& size) {
  const int sizes[3] = {size.x, size.y, size.z};
  Share share;
  for (int axis = 0; axis < 3; ++axis) {
    const double along = to.at(axis) - from.at(axis);
    const auto length = static_cast<double>(sizes[axis]);
    if (along == 0.0) {
      if (from.at(axis) < 0.0 || from.at(axis) >= length) return {0.0, 0.0};
      continue;
    }
    const double a = -from.at(axis) / along;
    const double b = (length - from.at(axis)) / along;
    share.enter = cuda::most_of(share.enter, cuda::least_of(a, b));
    share.leave = cuda::least_of(share.leave, cuda::most_of(a, b));
  }
  return share.enter >= share.leave ? Share{0.0, 0.0} : share;
}

/// The voxel of a point in voxels, drawn into the grid.
SIDESTEP_HOST_DEVICE inline cuda::Extent nearest_voxel(const Point& p, const cuda::Extent& size) {
  const auto drawn = [](double a, int length) {
    return static_cast<int>(
        cuda::least_of(cuda::most_of(floor(a), 0.0), static_cast<double>(length) - 1.0));
  };
  return {drawn(p.x, size.x), drawn(p.y, size.y), drawn(p.z, size.z)};
}

/// Sorts measurements into rays, a thread a measurement: marks the voxels where they end.
struct MarkEnds {
  static constexpr int kThreads = 256;
  static constexpr int kPhases = 3;
  struct Shared {
    std::uint32_t counts[kFates];
  };

  Grid grid;
  Marks hits;
  Marks free_ends;
  PointLimits limits;
  double T_world_camera[3][4] = {};
  Point origin_m;
  Point camera_vox;
  double resolution_m = 0.0;
  double fx_px = 0.0, fy_px = 0.0, cx_px = 0.0, cy_px = 0.0;
  const WorldBall* balls = nullptr;
  int ball_count = 0;
  Point balls_lower_m, balls_upper_m;  ///< The box around them all.
  std::int64_t count = 0;
  const CloudPoint* cloud = nullptr;  ///< Or, where this is null,
  const float* depth_m = nullptr;     ///< an image
  int width = 0;                      ///< so wide.
  std::uint32_t* counts = nullptr;    ///< By fate, and at kFates of rays that may be.

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t block, int thread, Shared& shared) const {
    if constexpr (kPhase == 0) {
      if (thread < kFates) shared.counts[thread] = 0;
    } else if constexpr (kPhase == 1) {
      const std::int64_t index = block * kThreads + thread;
      if (index < count) cuda::add_to(shared.counts[sort(index)], 1u);
    } else {
      if (thread < kFates && shared.counts[thread] != 0) {
        cuda::add_to(counts[thread], shared.counts[thread]);
      }
    }
  }

 private:
  SIDESTEP_HOST_DEVICE Fate sort(std::int64_t index) const {
    if (cloud != nullptr) {
      const CloudPoint p = cloud[index];
      return sort_point(
          {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)});
    }
    const float d = depth_m[index];
    const auto u = static_cast<double>(index % width);
    const auto v = static_cast<double>(index / width);
    if (d > 0.0F) return sort_point(unproject(u, v, static_cast<double>(d)));
    if (limits.clear_no_return && d == 0.0F) {
      const Point ray = unproject(u, v, 1.0);
      const double n = norm(ray);
      const double r = limits.max_range_m;
      free_to(to_world({ray.x / n * r, ray.y / n * r, ray.z / n * r}));
    }
    return kInvalid;
  }

  SIDESTEP_HOST_DEVICE Fate sort_point(const Point& p_camera) const {
    const Point p_world = to_world(p_camera);
    const double range_m = norm(p_camera);
    const bool is_finite = range_m <= cuda::kLargest;  // false for NaN, too
    if (!is_finite || range_m <= limits.min_range_m) return kInvalid;
    if (is_self(p_world)) return kSelf;
    if (range_m > limits.max_range_m) {
      const Point eye{T_world_camera[0][3], T_world_camera[1][3], T_world_camera[2][3]};
      const double share = limits.max_range_m / range_m;
      free_to({eye.x + share * (p_world.x - eye.x), eye.y + share * (p_world.y - eye.y),
               eye.z + share * (p_world.z - eye.z)});
      return kOutOfRange;
    }
    if (p_world.z < limits.floor_top_m) {
      free_to(p_world);
      return kFloor;
    }
    const Point p = to_vox(p_world);
    if (p.x >= 0.0 && p.x < static_cast<double>(grid.size.x) && p.y >= 0.0 &&
        p.y < static_cast<double>(grid.size.y) && p.z >= 0.0 &&
        p.z < static_cast<double>(grid.size.z)) {
      insert(hits, p);
      return kInsert;
    }
    free_to(p_world);
    return kOutside;
  }

  SIDESTEP_HOST_DEVICE void free_to(const Point& p_world) const {
    const Point to = to_vox(p_world);
    const Share share = clip(camera_vox, to, grid.size);
    if (share.leave <= share.enter) return;
    insert(free_ends, {camera_vox.x + share.leave * (to.x - camera_vox.x),
                       camera_vox.y + share.leave * (to.y - camera_vox.y),
                       camera_vox.z + share.leave * (to.z - camera_vox.z)});
  }
  SIDESTEP_HOST_DEVICE void insert(const Marks& marks, const Point& p) const {
    const cuda::Extent at = nearest_voxel(p, grid.size);
    marks.insert(grid.block_of(at.x, at.y, at.z), at.x, at.y, at.z);
  }

  [[nodiscard]] SIDESTEP_HOST_DEVICE Point unproject(double u, double v, double depth_m_) const {
    return {(u - cx_px) / fx_px * depth_m_, (v - cy_px) / fy_px * depth_m_, depth_m_};
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE Point to_world(const Point& p) const {
    const auto row = [&](const double(&m)[4]) {
      return m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3];
    };
    return {row(T_world_camera[0]), row(T_world_camera[1]), row(T_world_camera[2])};
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE Point to_vox(const Point& p) const {
    return {(p.x - origin_m.x) / resolution_m, (p.y - origin_m.y) / resolution_m,
            (p.z - origin_m.z) / resolution_m};
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE static double norm(const Point& p) {
    return sqrt(p.x * p.x + p.y * p.y + p.z * p.z);
  }

  [[nodiscard]] SIDESTEP_HOST_DEVICE bool is_self(const Point& p) const {
    if (ball_count == 0) return false;
    for (int axis = 0; axis < 3; ++axis) {
      if (p.at(axis) < balls_lower_m.at(axis) || p.at(axis) > balls_upper_m.at(axis)) return false;
    }
    for (int b = 0; b < ball_count; ++b) {
      const double dx = p.x - balls[b].centre_m.x;
      const double dy = p.y - balls[b].centre_m.y;
      const double dz = p.z - balls[b].centre_m.z;
      if (dx * dx + dy * dy + dz * dz <= balls[b].radius_m * balls[b].radius_m) return true;
    }
    return false;
  }
};

/// A voxel where a ray ends.
struct Ray {
  std::int32_t x, y, z;
  std::int32_t end_is_free;
};

/// Lists the rays of marked ends: a block of threads a block of voxels, a thread a row. The free
/// ends leave their set.
struct GatherRays {
  static constexpr int kThreads = cuda::kBlockRows;
  static constexpr int kPhases = 2;
  struct Shared {};

  Grid grid;
  Marks hits;
  Marks free_ends;
  Ray* rays = nullptr;
  std::uint32_t* ray_count = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t block, int row, Shared&) const {
    if constexpr (kPhase == 0) {
      if (hits.blocks[block] == 0 && free_ends.blocks[block] == 0) return;
      const std::uint32_t free = free_ends.row(block, row);
      std::uint32_t ends = free | hits.row(block, row);
      if (ends == 0) return;
      const cuda::Extent first = grid.first_voxel(block);
      for (; ends != 0; ends &= ends - 1) {
        const int x = cuda::lowest_bit(ends);
        rays[cuda::add_to(*ray_count, 1u)] = {first.x + x, first.y + row % cuda::kBlockSide,
                                              first.z + row / cuda::kBlockSide,
                                              static_cast<std::int32_t>((free >> x) & 1u)};
      }
    } else {
      if (free_ends.blocks[block] != 0 && row % 2 == 0) free_ends.clear_pair(block, row);
    }
  }
};

/// Marks the voxels that rays pass through, a thread a ray.
struct WalkRays {
  static constexpr int kThreads = 128;
  static constexpr int kPhases = 1;
  struct Shared {};

  Grid grid;
  Marks misses;
  Point camera_vox;
  const Ray* rays = nullptr;
  const std::uint32_t* ray_count = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t block, int thread, Shared&) const {
    const std::int64_t index = block * kThreads + thread;
    if (index < *ray_count) walk(rays[index]);
  }

 private:
  SIDESTEP_HOST_DEVICE void walk(const Ray& ray) const {
    const Point to{ray.x + 0.5, ray.y + 0.5, ray.z + 0.5};
    const Share share = clip(camera_vox, to, grid.size);
    if (share.leave <= share.enter) return;
    const Point along{to.x - camera_vox.x, to.y - camera_vox.y, to.z - camera_vox.z};
    const cuda::Extent first =
        nearest_voxel({camera_vox.x + share.enter * along.x, camera_vox.y + share.enter * along.y,
                       camera_vox.z + share.enter * along.z},
                      grid.size);
    Axis x = axis_of(first.x, ray.x, camera_vox.x, along.x);
    Axis y = axis_of(first.y, ray.y, camera_vox.y, along.y);
    Axis z = axis_of(first.z, ray.z, camera_vox.z, along.z);
    while (x.voxel != x.end || y.voxel != y.end || z.voxel != z.end) {
      mark(x.voxel, y.voxel, z.voxel);
      const bool is_x_before_y = x.next < y.next;
      if (z.next < (is_x_before_y ? x.next : y.next)) {
        advance(z);
      } else if (is_x_before_y) {
        advance(x);
      } else {
        advance(y);
      }
    }
    if (ray.end_is_free != 0) mark(x.voxel, y.voxel, z.voxel);
  }

  /// Where a walk is along one axis.
  struct Axis {
    int voxel, end, step;
    double next;   ///< Parameter at which the ray leaves the voxel.
    double delta;  ///< Parameter from one plane of voxels to the next.
  };
  [[nodiscard]] SIDESTEP_HOST_DEVICE static Axis axis_of(int voxel, int end, double from,
                                                         double along) {
    const int step = end > voxel ? 1 : -1;
    const double plane = voxel + (step > 0 ? 1.0 : 0.0);
    // An axis that has arrived is left alone: the walk always ends in the ray's end voxel.
    return {voxel, end, step, end == voxel ? cuda::kInfinity : (plane - from) / along,
            1.0 / magnitude(along)};
  }
  SIDESTEP_HOST_DEVICE static void advance(Axis& axis) {
    axis.voxel += axis.step;
    axis.next = axis.voxel == axis.end ? cuda::kInfinity : axis.next + axis.delta;
  }
  SIDESTEP_HOST_DEVICE void mark(int x, int y, int z) const {
    misses.insert(grid.block_of(x, y, z), x, y, z);
  }
};

/// Adds a hit to the voxels that were hit and a miss to those that rays passed through and were
/// not; empties all sets.
struct IntegrateMarks {
  static constexpr int kThreads = cuda::kBlockRows;
  static constexpr int kPhases = 3;
  struct Shared {
    int changed;
  };

  Grid grid;
  Marks hits;
  Marks misses;
  Marks free_ends;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t block, int row, Shared& shared) const {
    if constexpr (kPhase == 0) {
      if (row == 0) shared.changed = 0;
    } else if constexpr (kPhase == 1) {
      if (hits.blocks[block] == 0 && misses.blocks[block] == 0) return;
      const cuda::Extent first = grid.first_voxel(block);
      const std::uint32_t hit = hits.row(block, row);
      const std::uint32_t miss = misses.row(block, row);
      if ((hit | miss) == 0) return;
      RowChange change;
      for (int i = 0; i < cuda::kBlockSide; ++i) {
        change.delta[i] = ((hit >> i) & 1u) != 0    ? grid.model.hit
                          : ((miss >> i) & 1u) != 0 ? grid.model.miss
                                                    : std::int16_t{0};
      }
      const RowOutcome outcome = add_row(
          grid, block, row, cuda::least_of(cuda::kBlockSide, grid.size.x - first.x), change);
      if (outcome.changed) cuda::raise_to(shared.changed, 1);
    } else {
      if (row % 2 == 0) {
        if (hits.blocks[block] != 0) hits.clear_pair(block, row);
        if (misses.blocks[block] != 0) misses.clear_pair(block, row);
      }
      if (row == 0 && shared.changed != 0) grid.changed[block] = 1;
    }
  }
};

/// Empties the flags of the sets, and says that no block that they name is settled any more.
struct ForgetMarks {
  static constexpr int kThreads = 256;
  static constexpr int kPhases = 1;
  struct Shared {};

  Grid grid;
  Marks hits;
  Marks misses;
  Marks free_ends;
  std::int64_t blocks = 0;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t block, int thread, Shared&) const {
    const std::int64_t at = block * kThreads + thread;
    if (at >= blocks) return;
    if (hits.blocks[at] != 0 || misses.blocks[at] != 0) grid.settled[at] = 0;
    hits.blocks[at] = 0;
    misses.blocks[at] = 0;
    free_ends.blocks[at] = 0;
  }
};

}  // namespace sidestep::voxel_grid_cuda
