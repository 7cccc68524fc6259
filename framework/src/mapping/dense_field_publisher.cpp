#include <sidestep/mapping/dense_field_publisher.hpp>

#include <algorithm>

namespace sidestep {

DenseFieldPublisher::DenseFieldPublisher(FieldInfo info, const OccupancyView& view,
                                         WorkerPool& workers)
    : info_(std::move(info)),
      view_(view),
      workers_(workers),
      blocks_(static_cast<std::size_t>(block_counts(info_.grid).prod())) {}

std::vector<std::uint8_t> DenseFieldPublisher::changed_blocks(const MapUpdate& update) const {
  const bool first = blocks_.front() == nullptr;
  std::vector<std::uint8_t> changed(blocks_.size(), first ? 1 : 0);
  for (const std::int32_t block : update.changed_blocks) {
    changed[static_cast<std::size_t>(block)] = 1;
  }
  return changed;
}

std::shared_ptr<const DistanceField> DenseFieldPublisher::publish(
    const MapUpdate& update, const std::vector<std::uint8_t>& changed, const RowWriter& write_row) {
  constexpr int kBlocksATask = 8;
  const Eigen::Vector3i counts = block_counts(info_.grid);
  workers_.run_banded(static_cast<int>(blocks_.size()), kBlocksATask, [&](int begin, int end) {
    for (int b = begin; b < end; ++b) {
      const auto block = static_cast<std::size_t>(b);
      if (changed[block] == 0) continue;
      auto fresh = std::make_shared<FieldBlock>();
      fill({b % counts.x(), b / counts.x() % counts.y(), b / (counts.x() * counts.y())}, write_row,
           *fresh);
      const FieldBlock* old = blocks_[block].get();
      if (old == nullptr || old->distance_m != fresh->distance_m || old->known != fresh->known) {
        blocks_[block] = std::move(fresh);
      }
    }
  });
  info_.sequence = update.sequence;
  info_.stamp = update.stamp;
  return std::make_shared<const DenseField>(info_, blocks_);
}

void DenseFieldPublisher::fill(const Eigen::Vector3i& block, const RowWriter& write_row,
                               FieldBlock& out) const {
  constexpr int kSide = kBlockSide_vox;
  const Eigen::Vector3i& size = info_.grid.size_vox;
  const VoxelBits known = view_.known();
  const int x = block.x() * kSide;
  const int count = std::min(kSide, size.x() - x);
  out.distance_m.fill(0.0f);
  out.known.fill(0);
  for (int k = 0; k < kSide && block.z() * kSide + k < size.z(); ++k) {
    for (int j = 0; j < kSide && block.y() * kSide + j < size.y(); ++j) {
      const int y = block.y() * kSide + j;
      const int z = block.z() * kSide + k;
      const auto row_in_block = static_cast<std::size_t>(j + kSide * k);
      write_row(x, y, z, count, out.distance_m.data() + row_in_block * kSide);
      const std::size_t row = static_cast<std::size_t>(y) +
                              static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(z);
      const std::uint64_t word = known.words[row * static_cast<std::size_t>(known.words_per_row) +
                                             static_cast<std::size_t>(x / 64)];
      out.known[row_in_block] = static_cast<std::uint16_t>(word >> (x % 64));
    }
  }
}

}  // namespace sidestep
