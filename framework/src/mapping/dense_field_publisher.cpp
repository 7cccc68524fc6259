#include <sidestep/core/index.hpp>
#include <sidestep/mapping/dense_field_publisher.hpp>

#include <algorithm>
#include <cstring>
#include <string>

namespace sidestep {
namespace {

constexpr int kSide = kBlockSide_vox;

/// Bit for bit, so that no value is mistaken for another.
// NOLINTBEGIN(bugprone-suspicious-memory-comparison)
bool same(const FieldBlock& a, const FieldBlock& b) noexcept {
  return std::memcmp(a.distance_m.data(), b.distance_m.data(), sizeof(a.distance_m)) == 0;
}
bool same(const KnownBlock& a, const KnownBlock& b) noexcept { return a.rows == b.rows; }

/// Whether every element equals the first: equal to itself moved by one.
template <class Array>
bool is_uniform(const Array& values) noexcept {
  return std::memcmp(values.data(), values.data() + 1, sizeof(values) - sizeof(values[0])) == 0;
}
// NOLINTEND(bugprone-suspicious-memory-comparison)
bool is_uniform(const FieldBlock& block) noexcept { return is_uniform(block.distance_m); }
bool is_uniform(const KnownBlock& block) noexcept { return is_uniform(block.rows); }

}  // namespace

template <class Block>
std::shared_ptr<const Block> UniformBlocks<Block>::shared(const Block& written,
                                                          const std::shared_ptr<const Block>& old) {
  constexpr std::size_t kMost = 8;
  if (old != nullptr && same(*old, written)) return old;
  if (!is_uniform(written)) return std::make_shared<const Block>(written);
  const std::scoped_lock lock(mutex_);
  for (const auto& block : uniform_) {
    if (same(*block, written)) return block;
  }
  auto block = std::make_shared<const Block>(written);
  if (uniform_.size() < kMost) uniform_.push_back(block);
  return block;
}

template class UniformBlocks<FieldBlock>;
template class UniformBlocks<KnownBlock>;

DenseFieldPublisher::DenseFieldPublisher(FieldInfo info, const OccupancyView& view,
                                         WorkerPool& workers)
    : info_(std::move(info)),
      view_(view),
      workers_(workers),
      blocks_(idx(block_counts(info_.grid).prod())),
      known_(blocks_.size()) {}

Result<std::vector<std::uint8_t>> DenseFieldPublisher::begin(const MapUpdate& update) {
  if (sequence_ && update.sequence != *sequence_ + 1) {
    return invalid("update " + std::to_string(update.sequence) + " of the map follows update " +
                   std::to_string(*sequence_) + "; a field needs every update once, in order");
  }
  std::vector<std::uint8_t> changed(blocks_.size(), sequence_ ? 0 : 1);
  for (const std::int32_t block : update.changed_blocks) {
    if (block < 0 || idx(block) >= blocks_.size()) {
      return invalid("the map says that block " + std::to_string(block) +
                     " changed; its grid has blocks 0 to " + std::to_string(blocks_.size() - 1));
    }
    changed[idx(block)] = 1;
  }
  sequence_ = update.sequence;
  known_changed_ = changed;
  return changed;
}

std::shared_ptr<const DistanceField> DenseFieldPublisher::publish(
    const MapUpdate& update, const std::vector<std::uint8_t>& changed, const RowWriter& write_row) {
  const Eigen::Vector3i counts = block_counts(info_.grid);
  constexpr auto kPage = static_cast<int>(DenseField::Blocks::kPage);
  const auto block_count = static_cast<int>(blocks_.size());
  // Those whose blocks change; a page of the table is one thread's.
  std::vector<int> pages;
  for (int b = 0; b < block_count; ++b) {
    const auto at = idx(b);
    if (changed[at] == 0 && known_changed_[at] == 0) continue;
    if (pages.empty() || pages.back() != b / kPage) pages.push_back(b / kPage);
  }
  workers_.run_banded(static_cast<int>(pages.size()), 1, [&](int begin, int end) {
    FieldBlock distances;
    KnownBlock known;
    for (int i = begin * kPage; i < end * kPage; ++i) {
      const int b = pages[idx(i / kPage)] * kPage + i % kPage;
      if (b >= block_count) break;
      const auto at = idx(b);
      if (changed[at] == 0 && known_changed_[at] == 0) continue;
      const Eigen::Vector3i block(b % counts.x(), b / counts.x() % counts.y(),
                                  b / (counts.x() * counts.y()));
      if (changed[at] != 0) {
        write_distances(block, write_row, distances);
        auto shared = uniform_distances_.shared(distances, blocks_[at]);
        if (shared != blocks_[at]) blocks_.set(at, std::move(shared));
      }
      if (known_changed_[at] != 0) {
        write_known(block, known);
        auto shared = uniform_known_.shared(known, known_[at]);
        if (shared != known_[at]) known_.set(at, std::move(shared));
      }
    }
  });
  info_.sequence = update.sequence;
  info_.stamp = update.stamp;
  return std::make_shared<const DenseField>(info_, blocks_.share(), known_.share());
}

void DenseFieldPublisher::write_distances(const Eigen::Vector3i& block, const RowWriter& write_row,
                                          FieldBlock& out) const {
  const Eigen::Vector3i first = block * kSide;
  const Eigen::Vector3i end =
      (first + Eigen::Vector3i::Constant(kSide)).cwiseMin(info_.grid.size_vox);
  const int count = end.x() - first.x();
  const bool is_whole = (end - first).minCoeff() == kSide;
  if (!is_whole) out.distance_m.fill(0.0f);  // voxels beyond the grid
  for (int z = first.z(); z < end.z(); ++z) {
    for (int y = first.y(); y < end.y(); ++y) {
      const auto row = idx(y - first.y() + kSide * (z - first.z()));
      write_row(first.x(), y, z, count, out.distance_m.data() + row * kSide);
    }
  }
}

void DenseFieldPublisher::write_known(const Eigen::Vector3i& block, KnownBlock& out) const {
  const VoxelBits known = view_.known();
  const Eigen::Vector3i first = block * kSide;
  const Eigen::Vector3i& size = info_.grid.size_vox;
  const Eigen::Vector3i end = (first + Eigen::Vector3i::Constant(kSide)).cwiseMin(size);
  out.rows.fill(0);
  for (int z = first.z(); z < end.z(); ++z) {
    for (int y = first.y(); y < end.y(); ++y) {
      const std::size_t row = idx(y) + idx(size.y()) * idx(z);
      const std::uint64_t word = known.words[row * idx(known.words_per_row) + idx(first.x() / 64)];
      out.rows[idx(y - first.y() + kSide * (z - first.z()))] =
          static_cast<std::uint16_t>(word >> (first.x() % 64));
    }
  }
}

}  // namespace sidestep
