#include "closest_obstacles.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sidestep::incremental {
namespace {

/// Rows end with a border, so that steps need no check whether they leave the grid; up to a whole
/// number of tiles.
template <int kTile_vox>
int padded_row(int size_x) {
  return (size_x + kLargestStep_vox + kTile_vox - 1) / kTile_vox * kTile_vox;
}

}  // namespace

std::vector<Eigen::Vector3i> neighbourhood(int connectivity) {
  const int farthest2 = connectivity == 6 ? 1 : connectivity == 26 ? 3 : 2;
  std::vector<Eigen::Vector3i> steps;
  for (int z = -1; z <= 1; ++z) {
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) {
        const Eigen::Vector3i step(x, y, z);
        if (step.squaredNorm() > 0 && step.squaredNorm() <= farthest2) steps.push_back(step);
      }
    }
  }
  if (connectivity == 24) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const int length : {-kLargestStep_vox, kLargestStep_vox}) {
        steps.push_back(length * Eigen::Vector3i::Unit(axis));
      }
    }
  }
  return steps;
}

template <class Value>
bool ClosestObstacles<Value>::fits(const Eigen::Vector3i& size_vox, std::uint32_t cap) noexcept {
  const double pitch = padded_row<kTile_vox>(size_vox.x());
  const double slice = pitch * (size_vox.y() + kLargestStep_vox);
  const double count = slice * (size_vox.z() + 2.0 * kLargestStep_vox + 2.0);
  const double reach = std::sqrt(static_cast<double>(cap));
  const auto longest = [&](int size) { return std::min(reach, size - 1.0); };
  return count <= std::numeric_limits<std::int32_t>::max() &&
         cap <= std::numeric_limits<Value>::max() && longest(size_vox.x()) <= Offset::kLargestXY &&
         longest(size_vox.y()) <= Offset::kLargestXY && longest(size_vox.z()) <= Offset::kLargestZ;
}

template <class Value>
ClosestObstacles<Value>::ClosestObstacles(const Eigen::Vector3i& size_vox, std::uint32_t cap,
                                          std::span<const Eigen::Vector3i> steps, Start start)
    : size_(size_vox),
      cap_(cap),
      pitch_(padded_row<kTile_vox>(size_vox.x())),
      rows_(size_vox.y() + kLargestStep_vox),
      first_(kLargestStep_vox * pitch_ * (rows_ + 1) + kTile_vox),
      distance2_(make_large_array<Value>(
          static_cast<std::size_t>(2 * first_ + pitch_ * rows_ * size_vox.z()))),
      offset_(make_large_array<Offset>(
          static_cast<std::size_t>(2 * first_ + pitch_ * rows_ * size_vox.z()))),
      link_(make_large_array<Link>(
          static_cast<std::size_t>(2 * first_ + pitch_ * rows_ * size_vox.z()))) {
  for (const Eigen::Vector3i& step : steps) {
    steps_.push_back({step.x(), step.y(), step.z(),
                      step.x() + pitch_ * (step.y() + rows_ * step.z()),
                      Offset::difference(step.x(), step.y(), step.z())});
  }
  const auto tiles = static_cast<std::size_t>(pitch_ * rows_ * size_.z() / kTile_vox);
  touched_.assign((tiles / sizeof(std::uint64_t) + 1) * sizeof(std::uint64_t), 0);
  for (int z = 0; z < size_.z(); ++z) {
    for (int y = 0; y < size_.y(); ++y) {
      for (int v = index(0, y, z); v < index(size_.x(), y, z); ++v) {
        if (start == Start::kNoObstacles) {
          distance2_[v] = static_cast<Value>(cap_);
        } else {
          offset_[v] = Offset::of(0, 0, 0);
          link_[v] = {v, v};
        }
      }
    }
  }
}

template <class Value>
void ClosestObstacles<Value>::update(std::span<const Eigen::Vector3i> removed,
                                     std::span<const Eigen::Vector3i> inserted) {
  // All lists of vanished obstacles are taken apart before anything looks for another obstacle, so
  // that none is found that has vanished as well.
  for (const Eigen::Vector3i& v : removed) orphan_list(index(v));
  for (const Eigen::Vector3i& v : inserted) insert(index(v));
  for (const std::int32_t v : orphans_) adopt_orphan(v);
  orphans_.clear();
  propagate();
}

template <class Value>
void ClosestObstacles<Value>::orphan_list(int obstacle) {
  int v = obstacle;
  do {
    offset_[v] = {};
    distance2_[v] = static_cast<Value>(cap_);
    touch(v);
    orphans_.push_back(v);
    v = link_[v].next;
  } while (v != obstacle);
}

template <class Value>
void ClosestObstacles<Value>::insert(int obstacle) {
  if (offset_[obstacle].exists()) unlink(obstacle);
  link_[obstacle] = {obstacle, obstacle};
  offset_[obstacle] = Offset::of(0, 0, 0);
  distance2_[obstacle] = 0;
  touch(obstacle);
  next_queue_.push_back({obstacle, 0});
}

/// Gives a voxel the best of its neighbours' closest obstacles. Where no neighbour has one, the
/// wave that comes from farther away will reach it.
template <class Value>
void ClosestObstacles<Value>::adopt_orphan(int voxel) {
  Offset best;
  std::uint32_t best2 = distance2_[voxel];  // the cap, or 0 where an obstacle has come
  for (const Step& step : steps_) {
    Offset offset = offset_[voxel + step.index];
    if (!offset.exists()) continue;
    offset.bits += step.difference;
    const int x = offset.x();
    const int y = offset.y();
    const int z = offset.z();
    const auto distance2 = static_cast<std::uint32_t>(x * x + y * y + z * z);
    if (distance2 >= best2) continue;
    best2 = distance2;
    best = offset;
  }
  if (!best.exists()) return;
  const int obstacle = voxel + best.x() + pitch_ * (best.y() + rows_ * best.z());
  set_closest(voxel, obstacle, best, static_cast<Value>(best2));
}

/// The wave: whoever has changed offers its closest obstacle to its neighbours.
template <class Value>
void ClosestObstacles<Value>::propagate() {
  while (!next_queue_.empty()) {
    std::swap(queue_, next_queue_);
    for (const Waiting& waiting : queue_) {
      // A voxel that has changed again since waits once more.
      if (distance2_[waiting.voxel] == waiting.distance2) offer_to_neighbours(waiting.voxel);
    }
    queue_.clear();
  }
}

template <class Value>
void ClosestObstacles<Value>::offer_to_neighbours(int voxel) {
  const Offset offset = offset_[voxel];
  const int x = offset.x();
  const int y = offset.y();
  const int z = offset.z();
  const int obstacle = voxel + x + pitch_ * (y + rows_ * z);
  for (const Step& step : steps_) {
    const int dx = x - step.x;
    const int dy = y - step.y;
    const int dz = z - step.z;
    const auto distance2 = static_cast<std::uint32_t>(dx * dx + dy * dy + dz * dz);
    const int neighbour = voxel + step.index;
    if (distance2 >= distance2_[neighbour]) continue;
    if (offset_[neighbour].exists()) unlink(neighbour);
    set_closest(neighbour, obstacle, {offset.bits - step.difference},
                static_cast<Value>(distance2));
  }
}

/// For a voxel that is in no list.
template <class Value>
void ClosestObstacles<Value>::set_closest(int voxel, int obstacle, Offset offset, Value distance2) {
  const std::int32_t next = link_[obstacle].next;
  link_[voxel] = {next, obstacle};
  link_[next].previous = voxel;
  link_[obstacle].next = voxel;
  offset_[voxel] = offset;
  distance2_[voxel] = distance2;
  touch(voxel);
  next_queue_.push_back({voxel, distance2});
}

template <class Value>
void ClosestObstacles<Value>::unlink(int voxel) noexcept {
  const Link link = link_[voxel];
  link_[link.previous].next = link.next;
  link_[link.next].previous = link.previous;
}

template <class Value>
Eigen::Vector3i ClosestObstacles<Value>::voxel(int index) const noexcept {
  const int at = index - first_;
  return {at % pitch_, at / pitch_ % rows_, at / (pitch_ * rows_)};
}

template <class Value>
std::optional<Eigen::Vector3i> ClosestObstacles<Value>::closest(
    const Eigen::Vector3i& voxel) const {
  const Offset offset = offset_[index(voxel)];
  if (!offset.exists()) return std::nullopt;
  return voxel + Eigen::Vector3i(offset.x(), offset.y(), offset.z());
}

template <class Value>
Eigen::Vector3i ClosestObstacles<Value>::next(const Eigen::Vector3i& voxel) const {
  return this->voxel(link_[index(voxel)].next);
}

template <class Value>
Eigen::Vector3i ClosestObstacles<Value>::previous(const Eigen::Vector3i& voxel) const {
  return this->voxel(link_[index(voxel)].previous);
}

template class ClosestObstacles<std::uint16_t>;
template class ClosestObstacles<std::uint32_t>;

}  // namespace sidestep::incremental
