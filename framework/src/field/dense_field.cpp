#include <sidestep/field/dense_field.hpp>

#include <algorithm>
#include <limits>

namespace sidestep {
namespace {

/// A voxel as block number and place within the block.
struct Address {
  std::size_t block;
  std::size_t place;
};

Address address_of(int x, int y, int z, const Eigen::Vector3i& counts) noexcept {
  constexpr int kSide = kBlockSide_vox;
  const auto block =
      static_cast<std::size_t>(x / kSide + counts.x() * (y / kSide + counts.y() * (z / kSide)));
  const auto place =
      static_cast<std::size_t>(x % kSide + kSide * (y % kSide + kSide * (z % kSide)));
  return {block, place};
}

/// The trilinear interpolant of a cell's corners (z, y, x) at `f` in [0, 1]^3, and its gradient
/// per voxel.
struct Interpolated {
  double value;
  Eigen::Vector3d gradient;
};

inline Interpolated interpolate(const double (&corner)[2][2][2],
                                const Eigen::Vector3d& f) noexcept {
  const auto mix = [](double a, double b, double t) { return a + t * (b - a); };
  double along_x[2][2];  // z, y
  for (int k = 0; k < 2; ++k) {
    for (int j = 0; j < 2; ++j) along_x[k][j] = mix(corner[k][j][0], corner[k][j][1], f.x());
  }
  const double y0 = mix(along_x[0][0], along_x[0][1], f.y());
  const double y1 = mix(along_x[1][0], along_x[1][1], f.y());
  const auto slope_x = [&](int k, int j) { return corner[k][j][1] - corner[k][j][0]; };
  return {mix(y0, y1, f.z()),
          {mix(mix(slope_x(0, 0), slope_x(0, 1), f.y()), mix(slope_x(1, 0), slope_x(1, 1), f.y()),
               f.z()),
           mix(along_x[0][1] - along_x[0][0], along_x[1][1] - along_x[1][0], f.z()), y1 - y0}};
}

}  // namespace

DenseField::DenseField(FieldInfo info, Blocks blocks, KnownBlocks known)
    : DistanceField(std::move(info)),
      blocks_(std::move(blocks)),
      known_(std::move(known)),
      block_counts_(block_counts(this->info().grid)) {}

float DenseField::at(const Eigen::Vector3i& voxel) const noexcept {
  const Address a = address_of(voxel.x(), voxel.y(), voxel.z(), block_counts_);
  return blocks_.block(a.block).distance_m[a.place];
}

bool DenseField::known(const Eigen::Vector3i& voxel) const noexcept {
  const Address a = address_of(voxel.x(), voxel.y(), voxel.z(), block_counts_);
  return ((known_.block(a.block).rows[a.place / kBlockSide_vox] >> (a.place % kBlockSide_vox)) & 1u) !=
         0;
}

void DenseField::query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
                       std::span<Eigen::Vector3d> gradients,
                       std::span<FieldStatus> statuses) const noexcept {
  const GridSpec& grid = info().grid;
  const double inverse_resolution = 1.0 / grid.resolution_m;
  const Eigen::Vector3d last = (grid.size_vox.array() - 1).cast<double>();

  for (std::size_t n = 0; n < points_m.size(); ++n) {
    // Position in voxels from the centre of voxel (0, 0, 0).
    const Eigen::Vector3d p = ((points_m[n] - grid.origin_m) * inverse_resolution).array() - 0.5;
    if (!p.allFinite()) {
      distances_m[n] = std::numeric_limits<double>::quiet_NaN();
      if (!gradients.empty()) gradients[n].setZero();
      if (!statuses.empty()) statuses[n] = FieldStatus::kOutside;
      continue;
    }
    const Eigen::Vector3d clamped = p.cwiseMax(0.0).cwiseMin(last);
    const Eigen::Vector3i low =
        clamped.cast<int>()
            .cwiseMin(grid.size_vox.array().matrix() - Eigen::Vector3i::Constant(2))
            .cwiseMax(0);
    const Eigen::Vector3d f = clamped - low.cast<double>();
    const Eigen::Vector3i high =
        (low + Eigen::Vector3i::Ones()).cwiseMin(grid.size_vox - Eigen::Vector3i::Ones());

    double corner[2][2][2];  // z, y, x
    for (int k = 0; k < 2; ++k) {
      for (int j = 0; j < 2; ++j) {
        for (int i = 0; i < 2; ++i) {
          const Address a = address_of(i == 0 ? low.x() : high.x(), j == 0 ? low.y() : high.y(),
                                       k == 0 ? low.z() : high.z(), block_counts_);
          corner[k][j][i] = static_cast<double>(blocks_.block(a.block).distance_m[a.place]);
        }
      }
    }
    const Interpolated result = interpolate(corner, f);
    distances_m[n] = result.value;
    if (!gradients.empty()) {
      // Beyond the outermost centres the value no longer changes along that axis.
      gradients[n] =
          (p.array() == clamped.array()).select(result.gradient * inverse_resolution, 0.0);
    }
    if (!statuses.empty()) {
      const bool outside = (p.array() < -0.5).any() || (p.array() > last.array() + 0.5).any();
      const Eigen::Vector3i nearest = (clamped.array() + 0.5).cast<int>().matrix();
      statuses[n] = outside          ? FieldStatus::kOutside
                    : known(nearest) ? FieldStatus::kKnown
                                     : FieldStatus::kUnknown;
    }
  }
}

}  // namespace sidestep
