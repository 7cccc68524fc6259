#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <span>
#include <utility>
#include <variant>

#include <Eigen/Geometry>

#include <sidestep/core/index.hpp>
#include <sidestep/mapping/moving_obstacles.hpp>
#include "dilation.hpp"
#include "surface_points.hpp"

namespace sidestep {
namespace {

/// Marks the blocks that hold an occupied voxel.
void find_blocks(const VoxelBits& bits, const GridSpec& grid, std::vector<char>& blocks) {
  static_assert(64 % kBlockSide_vox == 0);
  const Eigen::Vector3i counts = block_counts(grid);
  blocks.assign(idx(counts.prod()), 0);
  std::size_t w = 0;
  for (int z = 0; z < grid.size_vox.z(); ++z) {
    for (int y = 0; y < grid.size_vox.y(); ++y) {
      for (int word = 0; word < bits.words_per_row; ++word, ++w) {
        for (std::uint64_t left = bits.words[w]; left != 0;) {
          const int x = std::countr_zero(left) / kBlockSide_vox;
          const int block = word * (64 / kBlockSide_vox) + x;
          blocks[idx(block_linear({block, y / kBlockSide_vox, z / kBlockSide_vox}, counts))] = 1;
          left &= x + 1 == 64 / kBlockSide_vox ? 0 : ~std::uint64_t{0} << (x + 1) * kBlockSide_vox;
        }
      }
    }
  }
}

/// Walks the cells of a given edge along the part [begin, end] of a ray (Amanatides and Woo 1987),
/// until `visit(cell, enter, leave)` says so; whether it did.
template <class Visit>
bool any_cell(const Eigen::Vector3d& start, const Eigen::Vector3d& direction, double begin,
              double end, int edge, Visit&& visit) {
  if (!(begin < end)) return false;
  Eigen::Vector3i cell;
  Eigen::Vector3i step;
  Eigen::Vector3d next;  // along the ray, to where it leaves the cell
  Eigen::Vector3d period;
  for (int axis = 0; axis < 3; ++axis) {
    const double at = (start[axis] + begin * direction[axis]) / edge;
    const double cell_begin = std::floor(at);
    const bool is_up = direction[axis] > 0.0;
    cell[axis] = static_cast<int>(cell_begin);
    step[axis] = is_up ? 1 : -1;
    period[axis] = direction[axis] != 0.0 ? edge / std::abs(direction[axis])
                                          : std::numeric_limits<double>::infinity();
    const double left = is_up ? cell_begin + 1.0 - at : at - cell_begin;
    next[axis] = direction[axis] != 0.0 ? begin + left * period[axis] : period[axis];
  }
  for (double enter = begin;;) {
    const int nearer = next[0] < next[1] ? 0 : 1;
    const int axis = next[nearer] < next[2] ? nearer : 2;
    const double leave = std::min(next[axis], end);
    if (visit(cell, enter, leave)) return true;
    if (next[axis] >= end) return false;
    cell[axis] += step[axis];
    next[axis] += period[axis];
    enter = leave;
  }
}

/// Boxes around what moves, cell by cell.
class Cells {
 public:
  explicit Cells(double edge_m) : edge_m_(edge_m) {}

  void add(const Eigen::Vector3d& p) {
    const std::array key{std::floor(p.z() / edge_m_), std::floor(p.y() / edge_m_),
                         std::floor(p.x() / edge_m_)};
    // Voxels come row by row: most lie in the cell of the one before.
    if (last_ == cells_.end() || last_->first != key) last_ = cells_.try_emplace(key).first;
    last_->second.box.extend(p);
    ++last_->second.count;
  }

  /// A ball around the voxels of each cell that has enough of them, and more than flicker on a
  /// surface that was looked along from `eye_m`.
  [[nodiscard]] std::vector<MovingBall> balls(double resolution_m, int least_vox,
                                              const Eigen::Vector3d& eye_m) const {
    const double half_diagonal_m = 0.5 * std::sqrt(3.0) * resolution_m;
    std::vector<MovingBall> balls;
    for (const auto& [key, cell] : cells_) {
      if (cell.count < least_vox || is_flicker(cell, resolution_m, eye_m)) continue;
      balls.push_back({cell.box.center(), 0.5 * cell.box.diagonal().norm() + half_diagonal_m});
    }
    return balls;
  }

 private:
  struct Cell {
    Eigen::AlignedBox3d box;
    int count = 0;
  };

  /// Rays at a grazing angle clear the voxels of a surface before they meet it, and find others
  /// again row by row: few voxels of one layer.
  [[nodiscard]] bool is_flicker(const Cell& cell, double resolution_m,
                                const Eigen::Vector3d& eye_m) const {
    constexpr double kGrazing = 0.34;  // a sine, of 20 degrees
    constexpr double kShare = 1.0 / 3.0;
    const double layer_vox = edge_m_ / resolution_m * edge_m_ / resolution_m;
    if (cell.count >= kShare * layer_vox) return false;
    const Eigen::Vector3d to_eye = (eye_m - cell.box.center()).normalized();
    return ((cell.box.sizes().array() < 0.5 * resolution_m) && (to_eye.array().abs() < kGrazing))
        .any();
  }

  double edge_m_;
  std::map<std::array<double, 3>, Cell> cells_;
  std::map<std::array<double, 3>, Cell>::iterator last_ = cells_.end();
};

}  // namespace

std::shared_ptr<const MovingObstacles> MotionDetector::update(const OccupancyView& map,
                                                              const Eigen::Vector3d& eye_m,
                                                              Stamp stamp) {
  auto moving = look(map, stamp);
  remember(map, eye_m, stamp);
  return moving;
}

std::shared_ptr<const MovingObstacles> MotionDetector::look(const OccupancyView& map, Stamp stamp) {
  const GridSpec& grid = map.occupancy_grid();
  if (!past_.empty() && (past_.back().grid != grid || stamp < past_.back().stamp)) past_.clear();
  const auto is_old_enough = [&](const Past& past) {
    return stamp.seconds() - past.stamp.seconds() >= settings_.memory_s;
  };
  while (past_.size() > 1 && is_old_enough(past_[1])) {
    spare_ = std::move(past_.front());
    past_.pop_front();
  }

  auto moving = std::make_shared<MovingObstacles>();
  moving->stamp = stamp;
  if (!past_.empty()) {
    Past& then = past_.front();
    const VoxelBits occupied = map.occupied();
    const auto per_row = idx(occupied.words_per_row);
    const auto ny = idx(grid.size_vox.y());
    Cells cells(settings_.cell_m);
    for (std::size_t w = 0; w < occupied.words.size(); ++w) {
      if (occupied.words[w] == 0) continue;  // most: what was there before need not be read
      const std::uint64_t moved = occupied.words[w] & then.known[w] & ~then.near_occupied[w];
      if (moved == 0) continue;
      const std::size_t row = w / per_row;
      const auto centre_m = [&](std::uint64_t bits) {
        return grid.centre_m({static_cast<int>(w % per_row) * 64 + std::countr_zero(bits),
                              static_cast<int>(row % ny), static_cast<int>(row / ny)});
      };
      for (std::uint64_t left = moved & ~(then.in_sight[w] | then.hidden[w]); left != 0;
           left &= left - 1) {
        (could_be_seen(centre_m(left), then) ? then.in_sight : then.hidden)[w] |=
            left & (~left + 1);
      }
      for (std::uint64_t left = moved & then.in_sight[w]; left != 0; left &= left - 1) {
        cells.add(centre_m(left));
      }
    }
    moving->balls = cells.balls(grid.resolution_m, settings_.least_vox, then.eyes_m.front());
  }
  return moving;
}

/// Whether a place could be seen from any of the places that the map was seen from.
bool MotionDetector::could_be_seen(const Eigen::Vector3d& p, const Past& then) {
  return std::ranges::any_of(then.eyes_m, [&](const Eigen::Vector3d& eye_m) {
    return could_be_seen_from(eye_m, p, then);
  });
}

/// Whether nothing that was occupied hid a place then, which lay in the open: looks along the ray
/// to the eye, voxel by voxel through those blocks that held something. Behind the place all was
/// free, as deep as depth is noisy: before surfaces that stood there, or were not in range, noise
/// occupies voxels.
bool MotionDetector::could_be_seen_from(const Eigen::Vector3d& eye_m, const Eigen::Vector3d& p,
                                        const Past& then) {
  const GridSpec& grid = then.grid;
  const VoxelBits known{then.known, then.words_per_row},
      occupied{then.occupied, then.words_per_row};
  const Eigen::Vector3i counts = block_counts(grid);
  const Eigen::Vector3d from_vox = (p - grid.origin_m) / grid.resolution_m;
  const Eigen::Vector3d way_vox = (eye_m - grid.origin_m) / grid.resolution_m - from_vox;
  const double length_vox = way_vox.norm();
  const Eigen::Vector3d direction = way_vox / length_vox;
  const double noise_vox = depth_noise_m(length_vox * grid.resolution_m) / grid.resolution_m;
  const auto is_not_free = [&](const Eigen::Vector3i& voxel, double, double) {
    return grid.contains(voxel) && (!known.at(grid, voxel) || occupied.at(grid, voxel));
  };
  if (any_cell(from_vox, -direction, 0.0, noise_vox, 1, is_not_free)) return false;
  const auto is_occupied = [&](const Eigen::Vector3i& voxel, double, double) {
    return grid.contains(voxel) && occupied.at(grid, voxel);
  };
  constexpr double kBeside_vox = 1.5;  // what is beside the place itself hides nothing
  return !any_cell(from_vox, direction, kBeside_vox, length_vox, kBlockSide_vox,
                   [&](const Eigen::Vector3i& block, double enter_vox, double leave_vox) {
                     if ((block.array() < 0).any() || (block.array() >= counts.array()).any()) {
                       return false;
                     }
                     return then.blocks[idx(block_linear(block, counts))] != 0 &&
                            any_cell(from_vox, direction, enter_vox, leave_vox, 1, is_occupied);
                   });
}

void MotionDetector::remember(const OccupancyView& map, const Eigen::Vector3d& eye_m, Stamp stamp) {
  const bool is_soon =
      !past_.empty() && stamp.seconds() - past_.back().stamp.seconds() < 0.5 * settings_.memory_s;
  const auto is_here = [&](const Eigen::Vector3d& other) {
    return (other - eye_m).norm() < kOtherPlace_m;
  };
  if (past_.empty()) eyes_m_.clear();
  std::erase_if(eyes_m_, is_here);
  eyes_m_.insert(eyes_m_.begin(), eye_m);
  if (is_soon) {
    // The first map is that of one camera: what others see is added as they find it.
    Past& first = past_.front();
    if (past_.size() > 1 || std::ranges::any_of(first.eyes_m, is_here)) return;
    first.eyes_m.push_back(eye_m);
    return note(map, first);
  }
  const GridSpec& grid = map.occupancy_grid();
  Past& past = past_.emplace_back(std::exchange(spare_, {}));
  past.stamp = stamp;
  past.eyes_m = std::exchange(eyes_m_, {});
  past.grid = grid;
  past.words_per_row = map.occupied().words_per_row;
  past.known.assign(map.known().words.size(), 0);
  past.occupied.assign(past.known.size(), 0);
  note(map, past);
}

/// Notes what is known in a map and was not known yet.
void MotionDetector::note(const OccupancyView& map, Past& past) {
  const VoxelBits known = map.known(), occupied = map.occupied();
  for (std::size_t w = 0; w < past.known.size(); ++w) {
    past.occupied[w] |= occupied.words[w] & ~past.known[w];
    past.known[w] |= known.words[w];
  }
  const VoxelBits all{past.occupied, past.words_per_row};
  find_blocks(all, past.grid, past.blocks);
  dilate(all, past.grid, past.in_sight, past.near_occupied);
  past.in_sight.assign(past.known.size(), 0);
  past.hidden.assign(past.known.size(), 0);
}

void MotionMemory::add_unseen(const Frame& frame, MovingObstacles& moving) {
  constexpr double kMemory_s = 3.0;
  constexpr double kBeside_m = 0.3;  // what is found so near is it
  const auto* image = std::get_if<DepthImage>(&frame.measurement);
  const Transform T_camera_world = frame.T_world_camera.inverse();
  const auto is_in_view = [&](const MovingBall& ball) {
    if (image == nullptr) return false;
    const Eigen::Vector3d p = T_camera_world * ball.centre_m;
    if (p.z() <= 0.0) return false;
    const double u = image->camera.fx_px * p.x() / p.z() + image->camera.cx_px;
    const double v = image->camera.fy_px * p.y() / p.z() + image->camera.cy_px;
    if (u < 0.0 || v < 0.0 || u > image->camera.width_px - 1 || v > image->camera.height_px - 1) {
      return false;
    }
    // Nothing in front of it hides it; where nothing came back, nothing is known.
    const double depth_m = image->at(static_cast<int>(u), static_cast<int>(v));
    return depth_m > 0.0 && depth_m > p.z() - ball.radius_m - kBeside_m;
  };
  const std::size_t found = moving.balls.size();
  for (const MovingBall& ball : balls_) {
    const double age_s = frame.stamp.seconds() - ball.seen->seconds();
    const bool is_found =
        std::ranges::any_of(std::span(moving.balls).first(found), [&](const MovingBall& other) {
          return (other.centre_m - ball.centre_m).norm() < ball.radius_m + kBeside_m;
        });
    if (age_s < 0.0 || age_s > kMemory_s || is_found || is_in_view(ball)) {
      continue;
    }
    moving.balls.push_back(ball);
  }
  balls_ = moving.balls;
  for (std::size_t i = 0; i < found; ++i) balls_[i].seen = moving.stamp;
}

}  // namespace sidestep
