#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "transform.hpp"

/// What a transform must do, wherever it runs: each check returns the first thing that is wrong, or
/// nothing. No test library, so that they run where there is nothing but a GPU and nvcc. What they
/// compare with is a search through all voxels.
namespace sidestep::edt_cuda::checks {

struct Case {
  std::string name;
  cuda::Extent size;
  std::uint32_t cap = 0;
  bool is_signed = false;
  int steps = 10;
  /// Voxels compared with the search in a step; all where 0.
  int sampled = 0;
};

/// Obstacles that come and go.
class World {
 public:
  World(const cuda::Extent& size, unsigned seed)
      : size_(size),
        blocks_{(size.x + 15) / 16, (size.y + 15) / 16, (size.z + 15) / 16},
        occupied_(static_cast<std::size_t>(size.x) * static_cast<std::size_t>(size.y) *
                  static_cast<std::size_t>(size.z)),
        changed_(static_cast<std::size_t>(blocks_.x * blocks_.y * blocks_.z), 1),
        random_(seed) {}

  [[nodiscard]] const cuda::Extent& size() const { return size_; }
  [[nodiscard]] const cuda::Extent& blocks() const { return blocks_; }
  [[nodiscard]] std::size_t at(int x, int y, int z) const {
    return static_cast<std::size_t>(x) +
           static_cast<std::size_t>(size_.x) *
               (static_cast<std::size_t>(y) +
                static_cast<std::size_t>(size_.y) * static_cast<std::size_t>(z));
  }
  [[nodiscard]] bool occupied(int x, int y, int z) const { return occupied_[at(x, y, z)] != 0; }
  [[nodiscard]] std::int32_t block_of(int x, int y, int z) const {
    return x / 16 + blocks_.x * (y / 16 + blocks_.y * (z / 16));
  }
  [[nodiscard]] int below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(random_); }

  void set(int x, int y, int z, bool occupied) {
    occupied_[at(x, y, z)] = occupied ? 1 : 0;
    changed_[static_cast<std::size_t>(block_of(x, y, z))] = 1;
  }
  /// A box appears or vanishes, at times everything does.
  void step() {
    if (below(12) == 0) return fill_box({0, 0, 0}, size_, below(2) == 0);
    for (int boxes = below(3); boxes >= 0; --boxes) {
      const cuda::Extent low{below(size_.x), below(size_.y), below(size_.z)};
      const int longest = below(4) == 0 ? 40 : 4;
      fill_box(low,
               {low.x + 1 + below(longest), low.y + 1 + below(longest), low.z + 1 + below(longest)},
               below(5) < 3);
    }
  }
  void fill_box(const cuda::Extent& low, const cuda::Extent& end, bool occupied) {
    for (int z = low.z; z < std::min(end.z, size_.z); ++z) {
      for (int y = low.y; y < std::min(end.y, size_.y); ++y) {
        for (int x = low.x; x < std::min(end.x, size_.x); ++x) set(x, y, z, occupied);
      }
    }
  }

  /// The blocks that were touched since the call before.
  [[nodiscard]] std::vector<std::int32_t> take_changed() {
    std::vector<std::int32_t> blocks;
    for (std::size_t b = 0; b < changed_.size(); ++b) {
      if (changed_[b] != 0) blocks.push_back(static_cast<std::int32_t>(b));
    }
    std::ranges::fill(changed_, std::uint8_t{0});
    return blocks;
  }
  void rows(std::int32_t block, std::uint16_t* rows) const {
    const int x0 = block % blocks_.x * 16;
    const int y0 = block / blocks_.x % blocks_.y * 16;
    const int z0 = block / (blocks_.x * blocks_.y) * 16;
    for (int row = 0; row < cuda::kBlockRows; ++row) {
      const int y = y0 + row % 16;
      const int z = z0 + row / 16;
      unsigned bits = 0;
      for (int i = 0; i < 16 && y < size_.y && z < size_.z && x0 + i < size_.x; ++i) {
        bits |= occupied(x0 + i, y, z) ? 1u << i : 0u;
      }
      rows[row] = static_cast<std::uint16_t>(bits);
    }
  }

  /// From the definition: the squared distance to the nearest voxel of the other kind.
  [[nodiscard]] int searched(int x, int y, int z, std::uint32_t cap, bool is_signed) const {
    const bool is_inside = occupied(x, y, z);
    if (is_inside && !is_signed) return 0;
    std::int64_t least = cap;
    const int reach = static_cast<int>(std::sqrt(static_cast<double>(cap))) + 1;
    for (int k = std::max(0, z - reach); k < std::min(size_.z, z + reach + 1); ++k) {
      for (int j = std::max(0, y - reach); j < std::min(size_.y, y + reach + 1); ++j) {
        for (int i = std::max(0, x - reach); i < std::min(size_.x, x + reach + 1); ++i) {
          if (occupied(i, j, k) == is_inside) continue;
          const std::int64_t dx = i - x, dy = j - y, dz = k - z;
          least = std::min(least, dx * dx + dy * dy + dz * dz);
        }
      }
    }
    return static_cast<int>(is_inside ? -least : least);
  }

 private:
  cuda::Extent size_, blocks_;
  std::vector<std::uint8_t> occupied_;
  std::vector<std::uint8_t> changed_;
  std::mt19937 random_;
};

/// The field as the host has it from what a transform reports as changed.
class Mirror {
 public:
  explicit Mirror(const World& world)
      : world_(world), values_(world.at(0, 0, world.size().z), 1 << 30) {}

  /// What is wrong with a report, or nothing: blocks out of order, ones that did not change, values
  /// beyond the grid that are not 0.
  std::string take(const ChangedDistances& changed, bool is_first) {
    for (std::size_t i = 0; i < changed.blocks.size(); ++i) {
      const std::int32_t block = changed.blocks[i];
      if (i > 0 && changed.blocks[i - 1] >= block) return "blocks out of order";
      if (!take_block(changed, i, block) && !is_first) {
        return "block " + std::to_string(block) + " is reported, but did not change";
      }
    }
    return wrong_;
  }
  [[nodiscard]] int at(int x, int y, int z) const { return values_[world_.at(x, y, z)]; }

 private:
  bool take_block(const ChangedDistances& changed, std::size_t place, std::int32_t block) {
    const cuda::Extent& blocks = world_.blocks();
    const int x0 = block % blocks.x * 16;
    const int y0 = block / blocks.x % blocks.y * 16;
    const int z0 = block / (blocks.x * blocks.y) * 16;
    bool differs = false;
    for (int v = 0; v < cuda::kBlockVoxels; ++v) {
      const int x = x0 + v % 16, y = y0 + v / 16 % 16, z = z0 + v / 256;
      const std::size_t at = place * cuda::kBlockVoxels + static_cast<std::size_t>(v);
      const int value = changed.far_vox2.empty() ? changed.near_vox2[at] : changed.far_vox2[at];
      if (x >= world_.size().x || y >= world_.size().y || z >= world_.size().z) {
        if (value != 0) wrong_ = "a value beyond the grid is not 0";
        continue;
      }
      int& kept = values_[world_.at(x, y, z)];
      differs = differs || kept != value;
      kept = value;
    }
    return differs;
  }

  const World& world_;
  std::vector<int> values_;
  std::string wrong_;
};

inline Result<ChangedDistances> update(DistanceTransform& transform, World& world) {
  const std::vector<std::int32_t> blocks = world.take_changed();
  const auto rows = transform.obstacle_rows(blocks.size());
  if (!rows) return error_of(rows);
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    world.rows(blocks[i], rows->data() + i * cuda::kBlockRows);
  }
  return transform.update(blocks);
}

/// Compares voxels with the search: all, or so many at random.
inline std::string compare(const Case& c, World& world, const Mirror& mirror) {
  const cuda::Extent& size = world.size();
  const auto wrong = [&](int x, int y, int z) -> std::string {
    const int expected = world.searched(x, y, z, c.cap, c.is_signed);
    if (mirror.at(x, y, z) == expected) return {};
    std::ostringstream text;
    text << "voxel " << x << " " << y << " " << z << " is " << mirror.at(x, y, z) << ", by search "
         << expected;
    return text.str();
  };
  for (int n = 0; n < c.sampled; ++n) {
    auto text = wrong(world.below(size.x), world.below(size.y), world.below(size.z));
    if (!text.empty()) return text;
  }
  if (c.sampled > 0) return {};
  for (int z = 0; z < size.z; ++z) {
    for (int y = 0; y < size.y; ++y) {
      for (int x = 0; x < size.x; ++x) {
        auto text = wrong(x, y, z);
        if (!text.empty()) return text;
      }
    }
  }
  return {};
}

/// Whether the transform equals the search through a sequence of changes, reports every block that
/// changed and no other.
inline std::string check_sequence(const MakeTransform& make, const Case& c) {
  auto transform = make({c.size, c.cap, c.is_signed});
  if (!transform) return transform.error().message;
  World world(c.size, 11);
  Mirror mirror(world);
  for (int step = 0; step < c.steps; ++step) {
    const auto changed = update(**transform, world);
    const std::string at = "step " + std::to_string(step) + ": ";
    if (!changed) return at + changed.error().message;
    if (auto wrong = mirror.take(*changed, step == 0); !wrong.empty()) return at + wrong;
    if (auto wrong = compare(c, world, mirror); !wrong.empty()) return at + wrong;
    world.step();
  }
  return {};
}

/// Sizes that fill no block, warp or segment, limits near, far and none.
inline std::vector<Case> small_cases() {
  return {{"near", {45, 70, 37}, 100, false, 12, 1500},
          {"near_signed", {45, 70, 37}, 100, true, 12, 1500},
          {"one_voxel", {33, 20, 18}, 1, true, 12},
          {"whole_blocks", {64, 64, 32}, 49, true, 6, 1500},
          {"far_signed", {37, 30, 67}, 37 * 37 + 30 * 30 + 67 * 67, true, 8, 200},
          {"far", {50, 131, 9}, 40000, false, 8, 200},
          {"flat", {1, 30, 140}, 1024, true, 12, 1000},
          {"thin", {300, 1, 1}, 90001, true, 12},
          {"single", {1, 1, 1}, 3, true, 6}};
}

/// Beyond 65,535 blocks of threads, and beyond any other size here. Compared at random places.
inline std::vector<Case> large_cases() {
  return {{"many_blocks", {96, 30000, 2}, 1024, true, 3, 300},
          {"long_lines", {20, 5, 8000}, 1u << 24, false, 3, 20}};
}

}  // namespace sidestep::edt_cuda::checks
