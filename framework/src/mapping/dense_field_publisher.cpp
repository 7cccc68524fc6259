#include <sidestep/mapping/dense_field_publisher.hpp>

#include <algorithm>
#include <cstring>
#include <string>

namespace sidestep {
namespace {

/// Bit for bit, so that no value is mistaken for another.
bool same(const FieldBlock& a, const FieldBlock& b) noexcept {
  return std::memcmp(a.distance_m.data(), b.distance_m.data(), sizeof(a.distance_m)) == 0 &&
         std::memcmp(a.known.data(), b.known.data(), sizeof(a.known)) == 0;
}

/// Whether every element equals the first: equal to itself moved by one.
template <class Array>
bool is_uniform(const Array& values) noexcept {
  return std::memcmp(values.data(), values.data() + 1, sizeof(values) - sizeof(values[0])) == 0;
}

}  // namespace

DenseFieldPublisher::DenseFieldPublisher(FieldInfo info, const OccupancyView& view,
                                         WorkerPool& workers)
    : info_(std::move(info)),
      view_(view),
      workers_(workers),
      blocks_(static_cast<std::size_t>(block_counts(info_.grid).prod())) {}

Result<std::vector<std::uint8_t>> DenseFieldPublisher::begin(const MapUpdate& update) {
  if (sequence_ && update.sequence != *sequence_ + 1) {
    return fail(ErrorCode::kInvalidArgument,
                "update " + std::to_string(update.sequence) + " of the map follows update " +
                    std::to_string(*sequence_) + "; a field needs every update once, in order");
  }
  std::vector<std::uint8_t> changed(blocks_.size(), sequence_ ? 0 : 1);
  for (const std::int32_t block : update.changed_blocks) {
    if (block < 0 || static_cast<std::size_t>(block) >= blocks_.size()) {
      return fail(ErrorCode::kInvalidArgument, "the map says that block " + std::to_string(block) +
                                                   " changed; its grid has blocks 0 to " +
                                                   std::to_string(blocks_.size() - 1));
    }
    changed[static_cast<std::size_t>(block)] = 1;
  }
  sequence_ = update.sequence;
  return changed;
}

std::shared_ptr<const DistanceField> DenseFieldPublisher::publish(
    const MapUpdate& update, const std::vector<std::uint8_t>& changed, const RowWriter& write_row) {
  constexpr int kBlocksATask = 8;
  const Eigen::Vector3i counts = block_counts(info_.grid);
  workers_.run_banded(static_cast<int>(blocks_.size()), kBlocksATask, [&](int begin, int end) {
    FieldBlock written;
    for (int b = begin; b < end; ++b) {
      const auto block = static_cast<std::size_t>(b);
      if (changed[block] == 0) continue;
      fill({b % counts.x(), b / counts.x() % counts.y(), b / (counts.x() * counts.y())}, write_row,
           written);
      blocks_[block] = shared(written, blocks_[block]);
    }
  });
  info_.sequence = update.sequence;
  info_.stamp = update.stamp;
  return std::make_shared<const DenseField>(info_, blocks_);
}

std::shared_ptr<const FieldBlock> DenseFieldPublisher::shared(
    const FieldBlock& written, const std::shared_ptr<const FieldBlock>& old) {
  constexpr std::size_t kMostUniform = 8;
  if (old != nullptr && same(*old, written)) return old;
  if (!is_uniform(written.distance_m) || !is_uniform(written.known)) {
    return std::make_shared<const FieldBlock>(written);
  }
  const std::scoped_lock lock(uniform_mutex_);
  for (const auto& block : uniform_) {
    if (same(*block, written)) return block;
  }
  auto block = std::make_shared<const FieldBlock>(written);
  if (uniform_.size() < kMostUniform) uniform_.push_back(block);
  return block;
}

void DenseFieldPublisher::fill(const Eigen::Vector3i& block, const RowWriter& write_row,
                               FieldBlock& out) const {
  constexpr int kSide = kBlockSide_vox;
  const Eigen::Vector3i& size = info_.grid.size_vox;
  const VoxelBits known = view_.known();
  const int x = block.x() * kSide;
  const int count = std::min(kSide, size.x() - x);
  const bool whole = ((block.array() + 1) * kSide <= size.array()).all();
  if (!whole) {  // voxels beyond the grid
    out.distance_m.fill(0.0f);
    out.known.fill(0);
  }
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
