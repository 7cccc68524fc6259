#include <sidestep/field/occupancy_bits.hpp>

#include <algorithm>
#include <bit>
#include <utility>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

constexpr int kSide = kBlockSide_vox;

/// The first voxel of a block.
Eigen::Vector3i first_voxel(std::int32_t block, const Eigen::Vector3i& counts) noexcept {
  return kSide * Eigen::Vector3i(block % counts.x(), block / counts.x() % counts.y(),
                                 block / (counts.x() * counts.y()));
}

std::uint16_t occupied_row(const float* distances_m) noexcept {
  unsigned bits = 0;
  for (int x = 0; x < kSide; ++x) bits |= static_cast<unsigned>(distances_m[x] <= 0.0F) << x;
  return static_cast<std::uint16_t>(bits);
}

/// Clears the bits of voxels that the grid does not have, `extent_vox` from the block's first one.
void cut_off(BlockBits& bits, const Eigen::Vector3i& extent_vox) noexcept {
  if ((extent_vox.array() >= kSide).all()) return;
  const auto columns = static_cast<std::uint16_t>((1U << std::min(extent_vox.x(), kSide)) - 1U);
  for (int row = 0; row < kSide * kSide; ++row) {
    const bool inside = row % kSide < extent_vox.y() && row / kSide < extent_vox.z();
    const std::uint16_t mask = inside ? columns : std::uint16_t{0};
    bits.occupied[idx(row)] &= mask;
    bits.known[idx(row)] &= mask;
  }
}

BlockBits bits_of(const DenseField& field, std::int32_t block) {
  const auto index = idx(block);
  BlockBits bits;
  const float* distances_m = field.blocks().block(index).distance_m.data();
  for (std::size_t row = 0; row < bits.occupied.size(); ++row) {
    bits.occupied[row] = occupied_row(distances_m + row * kSide);
  }
  bits.known = field.known_blocks().block(index).rows;
  return bits;
}

/// Sampled at the centres of the block's voxels.
BlockBits bits_of(const DistanceField& field, std::int32_t block) {
  const GridSpec& grid = field.info().grid;
  const Eigen::Vector3i first = first_voxel(block, block_counts(grid));
  constexpr std::size_t kVoxels = FieldBlock::kVoxels;
  std::vector<Eigen::Vector3d> centres_m(kVoxels);
  std::vector<double> distances_m(kVoxels);
  std::vector<FieldStatus> statuses(kVoxels);
  for (std::size_t i = 0; i < kVoxels; ++i) {
    const int v = static_cast<int>(i);
    centres_m[i] =
        grid.centre_m(first + Eigen::Vector3i(v % kSide, v / kSide % kSide, v / (kSide * kSide)));
  }
  field.query(centres_m, distances_m, {}, statuses);
  BlockBits bits;
  for (std::size_t i = 0; i < kVoxels; ++i) {
    const auto bit = static_cast<std::uint16_t>(1U << (i % kSide));
    if (distances_m[i] <= 0.0) bits.occupied[i / kSide] |= bit;
    if (statuses[i] == FieldStatus::kKnown) bits.known[i / kSide] |= bit;
  }
  return bits;
}

bool shares_block(const DenseField& a, const DenseField& b, std::size_t index) noexcept {
  return &a.blocks().block(index) == &b.blocks().block(index) &&
         &a.known_blocks().block(index) == &b.known_blocks().block(index);
}

}  // namespace

void OccupancyBits::start(const GridSpec& grid) {
  grid_ = grid;
  if (grid.voxel_count() > kMostVoxels) grid_.size_vox.setZero();
  blocks_.assign(idx(block_counts(grid_).prod()), BlockBits{});
  last_ = nullptr;
}

OccupancyBits::Change OccupancyBits::update(std::shared_ptr<const DistanceField> field) {
  Change change;
  const GridSpec& grid = field->info().grid;
  if (last_ == nullptr || !(grid == last_->info().grid)) {
    start(grid);
    change.is_new_grid = true;
  }
  const auto* const dense = dynamic_cast<const DenseField*>(field.get());
  const auto* const dense_before = dynamic_cast<const DenseField*>(last_.get());
  const Eigen::Vector3i counts = block_counts(grid_);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    if (dense != nullptr && dense_before != nullptr && shares_block(*dense, *dense_before, i)) {
      continue;
    }
    const auto index = static_cast<std::int32_t>(i);
    BlockBits bits = dense != nullptr ? bits_of(*dense, index) : bits_of(*field, index);
    cut_off(bits, grid_.size_vox - first_voxel(index, counts));
    if (bits == blocks_[i]) continue;
    blocks_[i] = bits;
    change.blocks.push_back(index);
  }
  last_ = std::move(field);
  return change;
}

void OccupancyBits::clear() {
  grid_ = {};
  blocks_.clear();
  last_ = nullptr;
}

std::vector<std::int32_t> OccupancyBits::filled() const {
  std::vector<std::int32_t> filled;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    if (blocks_[i] != BlockBits{}) filled.push_back(static_cast<std::int32_t>(i));
  }
  return filled;
}

std::vector<Eigen::Vector3d> OccupancyBits::occupied_centres_m() const {
  std::vector<Eigen::Vector3d> centres_m;
  const Eigen::Vector3i counts = block_counts(grid_);
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const Eigen::Vector3i first = first_voxel(static_cast<std::int32_t>(i), counts);
    for (int row = 0; row < kBlockSide_vox * kBlockSide_vox; ++row) {
      const auto at = idx(row);
      const unsigned bits = blocks_[i].occupied[at] & blocks_[i].known[at];
      for (unsigned rest = bits; rest != 0; rest &= rest - 1) {
        centres_m.push_back(
            grid_.centre_m(first + Eigen::Vector3i(std::countr_zero(rest), row % kBlockSide_vox,
                                                   row / kBlockSide_vox)));
      }
    }
  }
  return centres_m;
}

}  // namespace sidestep
