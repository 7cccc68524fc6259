#include "log_odds_grid.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep::voxel_grid {

Parameters<VoxelGridOptions> VoxelGridOptions::parameters() {
  using O = VoxelGridOptions;
  return declare_measurement(std::move(
      declare_sensor_model(declare_grid(Parameters<O>()))
          .add("sliding_window", &O::sliding_window,
               "Whether the grid moves with the camera along x and y, by blocks of 16 voxels; "
               "origin_m is where it lies in the first frame. What leaves it is forgotten.")
          .add("fade_half_life_s", &O::fade_half_life_s,
               "Time in which the log-odds of what is not seen halve, until it is unknown; 0: "
               "never.",
               {.unit = "s", .min = 0.0})));
}

LogOdds log_odds_of(const VoxelGridOptions& options) {
  const auto fixed = [](double log_odds) {
    return static_cast<std::int16_t>(std::lround(log_odds * LogOdds::kUnits));
  };
  return {fixed(options.l_hit), fixed(options.l_miss), fixed(options.l_min), fixed(options.l_max),
          fixed(options.occupied_at)};
}

double memory_mib(const VoxelGridOptions& options) {
  // Log-odds, two bitsets of the map, three of the frame (hits, misses, ends of rays).
  constexpr double kBytesPerVoxel = sizeof(std::int16_t) + 5.0 / 8.0;
  return voxels_of_blocks(options) * kBytesPerVoxel / (1 << 20);
}

std::vector<OptionMistake> VoxelGridOptions::check() const {
  std::vector<OptionMistake> mistakes = check_map_options(*this, memory_mib(*this));
  if (!(occupied_at > l_min && occupied_at <= l_max)) {
    mistakes.push_back({{"occupied_at", "l_min", "l_max"},
                        "must be above l_min and at most l_max, or no voxel ever changes; " +
                            detail::number_text(occupied_at) + " is not",
                        {}});
  }
  const bool has_whole_blocks =
      size_vox.x() % kBlockSide_vox == 0 && size_vox.y() % kBlockSide_vox == 0;
  if (sliding_window && !has_whole_blocks) {
    mistakes.push_back({{"size_vox", "sliding_window"},
                        "must be a multiple of " + std::to_string(kBlockSide_vox) +
                            " along x and y where sliding_window is on",
                        {}});
  }
  return mistakes;
}

LogOddsGrid::LogOddsGrid(const GridSpec& spec, LogOdds model)
    : spec_(spec),
      model_(model),
      counts_(block_counts(spec)),
      words_per_row_((spec.size_vox.x() + 63) / 64) {
  const std::size_t blocks = static_cast<std::size_t>(counts_.x()) *
                             static_cast<std::size_t>(counts_.y()) *
                             static_cast<std::size_t>(counts_.z());
  // Huge pages take a quarter less time under load.
  log_odds_ = make_large_array<std::int16_t>(blocks * kBlockVoxels);
  const std::size_t words = static_cast<std::size_t>(words_per_row_) *
                            static_cast<std::size_t>(spec.size_vox.y()) *
                            static_cast<std::size_t>(spec.size_vox.z());
  occupied_.resize(words);
  known_.resize(words);
  saturated_free_.resize(blocks);
  last_update_s_.resize(blocks);
  changed_.resize(blocks);
  slots_.resize(blocks);
  find_slots();
}

void LogOddsGrid::find_slots() {
  Eigen::Vector3i block;
  std::size_t linear = 0;
  for (block.z() = 0; block.z() < counts_.z(); ++block.z()) {
    for (block.y() = 0; block.y() < counts_.y(); ++block.y()) {
      for (block.x() = 0; block.x() < counts_.x(); ++block.x()) {
        const Eigen::Vector3i at((block.x() + ring_.x()) % counts_.x(),
                                 (block.y() + ring_.y()) % counts_.y(), block.z());
        slots_[linear++] = block_linear(at, counts_);
      }
    }
  }
}

void LogOddsGrid::forget(std::int32_t linear) {
  std::fill_n(block(linear), kBlockVoxels, std::int16_t{0});
  saturated_free(linear) = 0;
  last_update_s(linear) = 0.0;
}

void LogOddsGrid::move(const Eigen::Vector2i& blocks) {
  for (int axis = 0; axis < 2; ++axis) {
    spec_.origin_m[axis] += blocks[axis] * kBlockSide_vox * spec_.resolution_m;
    const int ring = (ring_[axis] + blocks[axis]) % counts_[axis];
    ring_[axis] = ring < 0 ? ring + counts_[axis] : ring;
  }
  find_slots();
  std::int32_t linear = 0;
  for (int z = 0; z < counts_.z(); ++z) {
    for (int y = 0; y < counts_.y(); ++y) {
      for (int x = 0; x < counts_.x(); ++x, ++linear) {
        const Eigen::Array2i was(x + blocks.x(), y + blocks.y());
        if ((was < 0).any() || (was >= counts_.head<2>().array()).any()) forget(linear);
      }
    }
  }
  occupied_ = moved(occupied_, blocks);
  known_ = moved(known_, blocks);
  std::ranges::fill(changed_, std::uint8_t{1});
}

std::vector<std::uint64_t> LogOddsGrid::moved(const std::vector<std::uint64_t>& words,
                                              const Eigen::Vector2i& blocks) const {
  std::vector<std::uint64_t> result(words.size());
  const int ny = spec_.size_vox.y();
  // A word holds four blocks.
  const int whole = blocks.x() >= 0 ? blocks.x() / 4 : -((3 - blocks.x()) / 4);
  const int shift = (blocks.x() - 4 * whole) * kBlockSide_vox;
  const int rest = spec_.size_vox.x() % 64;
  const std::uint64_t last = rest == 0 ? ~std::uint64_t{0} : (std::uint64_t{1} << rest) - 1;
  for (int z = 0; z < spec_.size_vox.z(); ++z) {
    for (int y = 0; y < ny; ++y) {
      const int from_y = y + blocks.y() * kBlockSide_vox;
      if (from_y < 0 || from_y >= ny) continue;
      const std::uint64_t* from =
          words.data() + row(from_y, z) * static_cast<std::size_t>(words_per_row_);
      std::uint64_t* to = result.data() + row(y, z) * static_cast<std::size_t>(words_per_row_);
      const auto word = [&](int w) { return w >= 0 && w < words_per_row_ ? from[w] : 0; };
      for (int w = 0; w < words_per_row_; ++w) {
        to[w] = word(w + whole) >> shift;
        if (shift != 0) to[w] |= word(w + whole + 1) << (64 - shift);
      }
      to[words_per_row_ - 1] &= last;
    }
  }
  return result;
}

double LogOddsGrid::log_odds(const Eigen::Vector3i& voxel) const noexcept {
  const Eigen::Vector3i block = voxel / kBlockSide_vox;
  const Eigen::Vector3i inner = voxel - block * kBlockSide_vox;
  const std::size_t at = slot(block_linear(block, counts_)) * kBlockVoxels +
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
