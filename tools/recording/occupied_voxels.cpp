#include "occupied_voxels.hpp"

#include <utility>

namespace sidestep {
namespace {

constexpr int kSide = kBlockSide_vox;

}  // namespace

bool OccupiedVoxels::update(std::shared_ptr<const DistanceField> field) {
  bool has_changed = last_ == nullptr || !(last_->info().grid == field->info().grid);
  if (has_changed) {
    grid_ = field->info().grid;
    if (grid_.voxel_count() > kMostVoxels) grid_.size_vox.setZero();
    blocks_.assign(static_cast<std::size_t>(block_counts(grid_).prod()), {});
    last_ = nullptr;
  }
  for (std::size_t block = 0; block < blocks_.size(); ++block) {
    if (is_same_block(*field, block)) continue;
    Voxels found = find(*field, block);
    if (found == blocks_[block]) continue;
    blocks_[block] = std::move(found);
    has_changed = true;
  }
  last_ = std::move(field);
  return has_changed;
}

bool OccupiedVoxels::is_same_block(const DistanceField& field, std::size_t block) const noexcept {
  const auto* const now = dynamic_cast<const DenseField*>(&field);
  const auto* const before = dynamic_cast<const DenseField*>(last_.get());
  return now != nullptr && before != nullptr &&
         &now->blocks().block(block) == &before->blocks().block(block) &&
         &now->known_blocks().block(block) == &before->known_blocks().block(block);
}

OccupiedVoxels::Voxels OccupiedVoxels::find(const DistanceField& field, std::size_t block) const {
  Voxels found;
  if (const auto* const dense = dynamic_cast<const DenseField*>(&field)) {
    const auto& distance_m = dense->blocks().block(block).distance_m;
    const auto& known = dense->known_blocks().block(block).rows;
    for (int i = 0; i < FieldBlock::kVoxels; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const bool is_known = ((known[at / kSide] >> (at % kSide)) & 1U) != 0;
      if (distance_m[at] <= 0.0F && is_known && grid_.contains(voxel(block, i))) {
        found.push_back(static_cast<std::uint16_t>(i));
      }
    }
    return found;
  }
  std::vector<Eigen::Vector3d> centres_m;
  for (int i = 0; i < FieldBlock::kVoxels; ++i)
    centres_m.push_back(grid_.centre_m(voxel(block, i)));
  std::vector<double> distances_m(centres_m.size());
  std::vector<FieldStatus> statuses(centres_m.size());
  field.query(centres_m, distances_m, {}, statuses);
  for (int i = 0; i < FieldBlock::kVoxels; ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (distances_m[at] <= 0.0 && statuses[at] == FieldStatus::kKnown) {
      found.push_back(static_cast<std::uint16_t>(i));
    }
  }
  return found;
}

Eigen::Vector3i OccupiedVoxels::voxel(std::size_t block, int index) const noexcept {
  const Eigen::Vector3i counts = block_counts(grid_);
  const auto b = static_cast<int>(block);
  return kSide * Eigen::Vector3i(b % counts.x(), b / counts.x() % counts.y(),
                                 b / (counts.x() * counts.y())) +
         Eigen::Vector3i(index % kSide, index / kSide % kSide, index / (kSide * kSide));
}

std::vector<Eigen::Vector3d> OccupiedVoxels::centres_m() const {
  std::vector<Eigen::Vector3d> centres_m;
  for (std::size_t block = 0; block < blocks_.size(); ++block) {
    for (const std::uint16_t index : blocks_[block]) {
      centres_m.push_back(grid_.centre_m(voxel(block, index)));
    }
  }
  return centres_m;
}

}  // namespace sidestep
