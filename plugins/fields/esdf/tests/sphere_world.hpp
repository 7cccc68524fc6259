#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/tsdf_view.hpp>

namespace sidestep::esdf {

/// A map with the TSDF of some balls, of which look() sees a box at a time, with noise: what a
/// mapper would offer, but with every value under a test's control.
class SphereWorld final : public Mapper, public TsdfView, public OccupancyView {
 public:
  struct Ball {
    Eigen::Vector3d centre_m;
    double radius_m;
  };
  static constexpr double kTruncation_vox = 4.0;
  std::vector<Ball> balls;

  explicit SphereWorld(const GridSpec& grid)
      : grid_(grid),
        words_per_row_((grid.size_vox.x() + 63) / 64),
        blocks_(static_cast<std::size_t>(block_counts(grid).prod())),
        known_(static_cast<std::size_t>(words_per_row_ * grid.size_vox.y() * grid.size_vox.z())),
        occupied_(known_.size()) {}

  /// Observes the voxels from low to high, both included, as they are now.
  MapUpdate look(const Eigen::Vector3i& low, const Eigen::Vector3i& high, double noise_m,
                 std::mt19937& random) {
    std::uniform_real_distribution<double> noise(-noise_m, noise_m);
    const double truncation = truncation_m();
    changed_.clear();
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int x = low.x(); x <= high.x(); ++x) {
          const double d = distance_m(grid_.centre_m({x, y, z})) + noise(random);
          set({x, y, z}, static_cast<float>(std::clamp(d, -truncation, truncation)));
        }
      }
    }
    std::ranges::sort(changed_);
    changed_.erase(std::unique(changed_.begin(), changed_.end()), changed_.end());
    MapUpdate update;
    update.sequence = ++sequence_;
    update.changed_blocks = changed_;
    return update;
  }
  MapUpdate look_at_all() {
    std::mt19937 random(1);
    return look(Eigen::Vector3i::Zero(), grid_.size_vox - Eigen::Vector3i::Ones(), 0.0, random);
  }

  [[nodiscard]] double distance_m(const Eigen::Vector3d& p) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Ball& ball : balls) {
      nearest = std::min(nearest, (p - ball.centre_m).norm() - ball.radius_m);
    }
    return nearest;
  }
  [[nodiscard]] bool observed(const Eigen::Vector3i& voxel) const {
    return known().at(grid_, voxel);
  }
  [[nodiscard]] float tsdf_m(const Eigen::Vector3i& voxel) const {
    return blocks_[block_of(voxel)]->distance_m[index(voxel)];
  }

  Result<MapUpdate> integrate(const Frame&) override { return MapUpdate{}; }
  [[nodiscard]] const GridSpec& grid() const noexcept override { return grid_; }
  [[nodiscard]] const GridSpec& tsdf_grid() const noexcept override { return grid_; }
  [[nodiscard]] const GridSpec& occupancy_grid() const noexcept override { return grid_; }
  [[nodiscard]] double truncation_m() const noexcept override {
    return kTruncation_vox * grid_.resolution_m;
  }
  [[nodiscard]] const TsdfBlock* tsdf_block(std::int32_t block) const noexcept override {
    return blocks_[static_cast<std::size_t>(block)].get();
  }
  [[nodiscard]] std::span<const std::int32_t> tsdf_changed_blocks() const noexcept override {
    return changed_;
  }
  [[nodiscard]] VoxelBits occupied() const noexcept override { return {occupied_, words_per_row_}; }
  [[nodiscard]] VoxelBits known() const noexcept override { return {known_, words_per_row_}; }

 private:
  void set(const Eigen::Vector3i& voxel, float tsdf_m) {
    auto& block = blocks_[block_of(voxel)];
    if (!block) block = std::make_unique<TsdfBlock>();
    block->distance_m[index(voxel)] = tsdf_m;
    block->weight[index(voxel)] = 1.0F;
    changed_.push_back(static_cast<std::int32_t>(block_of(voxel)));
    const auto row = static_cast<std::size_t>(voxel.y() + grid_.size_vox.y() * voxel.z()) *
                     static_cast<std::size_t>(words_per_row_);
    known_[row + static_cast<std::size_t>(voxel.x() / 64)] |= std::uint64_t{1} << (voxel.x() % 64);
  }
  [[nodiscard]] std::size_t block_of(const Eigen::Vector3i& voxel) const {
    return static_cast<std::size_t>(
        block_linear((voxel.array() / kBlockSide_vox).matrix(), block_counts(grid_)));
  }
  [[nodiscard]] static std::size_t index(const Eigen::Vector3i& voxel) {
    const Eigen::Vector3i in = voxel.unaryExpr([](int v) { return v % kBlockSide_vox; });
    return static_cast<std::size_t>(in.x() + 16 * (in.y() + 16 * in.z()));
  }

  GridSpec grid_;
  int words_per_row_;
  std::vector<std::unique_ptr<TsdfBlock>> blocks_;
  std::vector<std::uint64_t> known_, occupied_;
  std::vector<std::int32_t> changed_;
  std::int64_t sequence_ = 0;
};

/// The field's definition, solved by relaxing all voxels until none changes: a voxel near a
/// surface has its TSDF's distance; any other the least of what its 26 neighbours offer, which is
/// their own distance and the step, or, on the other side, the step; cut off at the limit.
class RelaxedField {
 public:
  RelaxedField(const SphereWorld& map, const std::string& unknown, double band_m, double limit_m)
      : grid_(map.grid()), cells_(grid_.voxel_count()) {
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      const Eigen::Vector3i v = voxel(i);
      Cell& cell = cells_[i];
      const bool observed = map.observed(v);
      cell.exists = observed || unknown != "ignored";
      cell.negative = observed ? map.tsdf_m(v) < 0.0F : unknown == "occupied";
      cell.fixed = observed && std::abs(map.tsdf_m(v)) < static_cast<float>(band_m);
      cell.distance_m = cell.fixed ? std::abs(map.tsdf_m(v)) : static_cast<float>(limit_m);
    }
    while (relax()) {
    }
  }

  [[nodiscard]] float at(const Eigen::Vector3i& v) const {
    const Cell& cell = cells_[grid_.linear(v)];
    return cell.negative ? -cell.distance_m : cell.distance_m;
  }
  /// The least that any path could be: straight lines from all voxels near surfaces on this side.
  [[nodiscard]] double straight_m(const Eigen::Vector3i& v) const {
    const Cell& cell = cells_[grid_.linear(v)];
    double least = static_cast<double>(cell.distance_m);
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      const double way_m = (voxel(i) - v).cast<double>().norm() * grid_.resolution_m;
      if (!cells_[i].exists) continue;
      if (cells_[i].negative != cell.negative) {
        least = std::min(least, way_m);
      } else if (cells_[i].fixed) {
        least = std::min(least, way_m + static_cast<double>(cells_[i].distance_m));
      }
    }
    return least;
  }

 private:
  struct Cell {
    bool exists = false, negative = false, fixed = false;
    float distance_m = 0.0F;
  };
  [[nodiscard]] Eigen::Vector3i voxel(std::size_t i) const {
    const auto n = static_cast<int>(i);
    return {n % grid_.size_vox.x(), n / grid_.size_vox.x() % grid_.size_vox.y(),
            n / (grid_.size_vox.x() * grid_.size_vox.y())};
  }
  bool relax() {
    bool changed = false;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      Cell& cell = cells_[i];
      if (!cell.exists || cell.fixed) continue;
      for (int n = 0; n < 27; ++n) {
        const Eigen::Vector3i way(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
        const Eigen::Vector3i from = voxel(i) + way;
        if (n == 13 || !grid_.contains(from) || !cells_[grid_.linear(from)].exists) continue;
        const Cell& other = cells_[grid_.linear(from)];
        const auto step_m = static_cast<float>(grid_.resolution_m *
                                               std::sqrt(static_cast<double>(way.squaredNorm())));
        const float offer_m = other.negative == cell.negative ? other.distance_m + step_m : step_m;
        if (offer_m >= cell.distance_m) continue;
        cell.distance_m = offer_m;
        changed = true;
      }
    }
    return changed;
  }

  GridSpec grid_;
  std::vector<Cell> cells_;
};

}  // namespace sidestep::esdf
