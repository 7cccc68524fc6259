#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include <sidestep/field/dense_field.hpp>

namespace sidestep::testing_support {

/// An axis-aligned box.
struct Aabb {
  Eigen::Vector3d lower_m;
  Eigen::Vector3d upper_m;

  [[nodiscard]] bool contains(const Eigen::Vector3d& p) const {
    return (p.array() >= lower_m.array()).all() && (p.array() <= upper_m.array()).all();
  }
  /// From a point outside to the box; 0 inside.
  [[nodiscard]] double distance_m(const Eigen::Vector3d& p) const {
    return (p - p.cwiseMax(lower_m).cwiseMin(upper_m)).norm();
  }
};

struct VoxelWorld {
  GridSpec grid;
  std::vector<Aabb> occupied;
  std::vector<Aabb> unknown;
  bool is_signed = false;
  double max_distance_m = 0.8;

  /// Centres of the voxels whose centre lies in an occupied box.
  [[nodiscard]] std::vector<Eigen::Vector3d> occupied_centres() const {
    std::vector<Eigen::Vector3d> centres;
    for_each([&](const Eigen::Vector3i& voxel) {
      if (is_in(occupied, grid.centre_m(voxel))) centres.push_back(grid.centre_m(voxel));
    });
    return centres;
  }

  /// The exact field, by comparing every voxel with every occupied one.
  [[nodiscard]] std::shared_ptr<const DenseField> field() const {
    std::vector<Eigen::Vector3d> full;
    std::vector<Eigen::Vector3d> empty;
    for_each([&](const Eigen::Vector3i& voxel) {
      const Eigen::Vector3d centre = grid.centre_m(voxel);
      (is_in(occupied, centre) ? full : empty).push_back(centre);
    });
    const Eigen::Vector3i counts = block_counts(grid);
    std::vector<std::shared_ptr<FieldBlock>> blocks(static_cast<std::size_t>(counts.prod()));
    std::vector<std::shared_ptr<KnownBlock>> known(blocks.size());
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      blocks[b] = std::make_shared<FieldBlock>();
      blocks[b]->distance_m.fill(0.0F);
      known[b] = std::make_shared<KnownBlock>();
      known[b]->rows.fill(0);
    }
    for_each([&](const Eigen::Vector3i& voxel) {
      const Eigen::Vector3d centre = grid.centre_m(voxel);
      double distance = nearest(centre, full);
      if (is_signed && distance == 0.0) distance = -nearest(centre, empty);
      const Eigen::Vector3i b = voxel / kBlockSide_vox;
      const Eigen::Vector3i in = voxel - b * kBlockSide_vox;
      const auto at = static_cast<std::size_t>(block_linear(b, counts));
      const int row = in.y() + kBlockSide_vox * in.z();
      blocks[at]->distance_m[static_cast<std::size_t>(in.x() + kBlockSide_vox * row)] =
          static_cast<float>(distance);
      if (!is_in(unknown, centre)) {
        std::uint16_t& bits = known[at]->rows[static_cast<std::size_t>(row)];
        bits = static_cast<std::uint16_t>(bits | (1u << in.x()));
      }
    });
    FieldInfo info;
    info.grid = grid;
    info.is_signed = is_signed;
    info.max_distance_m = max_distance_m;
    return std::make_shared<DenseField>(
        info, std::vector<DenseField::Blocks::Entry>(blocks.begin(), blocks.end()),
        std::vector<DenseField::KnownBlocks::Entry>(known.begin(), known.end()));
  }

 private:
  template <class Visit>
  void for_each(Visit visit) const {
    for (int k = 0; k < grid.size_vox.z(); ++k) {
      for (int j = 0; j < grid.size_vox.y(); ++j) {
        for (int i = 0; i < grid.size_vox.x(); ++i) visit(Eigen::Vector3i(i, j, k));
      }
    }
  }
  [[nodiscard]] static bool is_in(const std::vector<Aabb>& boxes, const Eigen::Vector3d& p) {
    for (const Aabb& box : boxes) {
      if (box.contains(p)) return true;
    }
    return false;
  }
  [[nodiscard]] double nearest(const Eigen::Vector3d& p,
                               const std::vector<Eigen::Vector3d>& points) const {
    double least = max_distance_m * max_distance_m;
    for (const Eigen::Vector3d& point : points) least = std::min(least, (point - p).squaredNorm());
    return std::sqrt(least);
  }
};

}  // namespace sidestep::testing_support
