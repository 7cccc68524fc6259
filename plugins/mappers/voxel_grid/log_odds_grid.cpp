#include "log_odds_grid.hpp"

#include <sys/mman.h>

#include <new>

namespace sidestep::voxel_grid {
namespace {

std::int16_t* map_zeroed(std::size_t bytes) {
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  madvise(memory, bytes, MADV_HUGEPAGE);  // a quarter less time under load; failure is harmless
  return static_cast<std::int16_t*>(memory);
}

}  // namespace

void Unmap::operator()(std::int16_t* memory) const noexcept { munmap(memory, bytes); }

LogOddsGrid::LogOddsGrid(const GridSpec& spec, LogOdds model)
    : spec_(spec),
      model_(model),
      counts_(block_counts(spec)),
      words_per_row_((spec.size_vox.x() + 63) / 64) {
  const std::size_t blocks = static_cast<std::size_t>(counts_.x()) *
                             static_cast<std::size_t>(counts_.y()) *
                             static_cast<std::size_t>(counts_.z());
  const std::size_t bytes = blocks * kBlockVoxels * sizeof(std::int16_t);
  log_odds_ = {map_zeroed(bytes), Unmap{bytes}};
  const std::size_t words = static_cast<std::size_t>(words_per_row_) *
                            static_cast<std::size_t>(spec.size_vox.y()) *
                            static_cast<std::size_t>(spec.size_vox.z());
  occupied_.resize(words);
  known_.resize(words);
  settled_free_.resize(blocks);
  changed_.resize(blocks);
}

double LogOddsGrid::log_odds(const Eigen::Vector3i& voxel) const noexcept {
  const Eigen::Vector3i block = voxel / kBlockSide_vox;
  const Eigen::Vector3i inner = voxel - block * kBlockSide_vox;
  const std::size_t at = static_cast<std::size_t>(block_linear(block, counts_)) * kBlockVoxels +
                         static_cast<std::size_t>(
                             inner.x() + kBlockSide_vox * (inner.y() + kBlockSide_vox * inner.z()));
  return log_odds_.get()[at] / LogOdds::kUnits;
}

std::vector<std::int32_t> LogOddsGrid::take_changed_blocks() {
  std::vector<std::int32_t> blocks;
  for (std::size_t b = 0; b < changed_.size(); ++b) {
    if (changed_[b] == 0) continue;
    blocks.push_back(static_cast<std::int32_t>(b));
    changed_[b] = 0;
  }
  return blocks;
}

}  // namespace sidestep::voxel_grid
