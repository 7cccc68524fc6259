#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/large_array.hpp>

namespace sidestep::incremental {

/// The way from a voxel to an obstacle, in voxels, packed into 32 bits so that a step to a
/// neighbour is one addition. |x|, |y| <= kLargestXY and |z| <= kLargestZ; all bits zero are no
/// offset.
struct Offset {
  static constexpr int kLargestXY = 1023;
  static constexpr int kLargestZ = 511;

  std::uint32_t bits = 0;

  [[nodiscard]] static constexpr Offset of(int x, int y, int z) noexcept {
    return {kZero + difference(x, y, z)};
  }
  /// What adding (x, y, z) to an offset adds to its bits.
  [[nodiscard]] static constexpr std::uint32_t difference(int x, int y, int z) noexcept {
    return static_cast<std::uint32_t>(x) + (static_cast<std::uint32_t>(y) << kShiftY) +
           (static_cast<std::uint32_t>(z) << kShiftZ);
  }

  [[nodiscard]] constexpr bool exists() const noexcept { return bits != 0; }
  [[nodiscard]] constexpr int x() const noexcept {
    return static_cast<int>(bits & 0x7ffu) - (kLargestXY + 1);
  }
  [[nodiscard]] constexpr int y() const noexcept {
    return static_cast<int>(bits >> kShiftY & 0x7ffu) - (kLargestXY + 1);
  }
  [[nodiscard]] constexpr int z() const noexcept {
    return static_cast<int>(bits >> kShiftZ) - (kLargestZ + 1);
  }

 private:
  static constexpr unsigned kShiftY = 11;
  static constexpr unsigned kShiftZ = 22;
  static constexpr std::uint32_t kZero = static_cast<std::uint32_t>(kLargestXY + 1) |
                                         static_cast<std::uint32_t>(kLargestXY + 1) << kShiftY |
                                         static_cast<std::uint32_t>(kLargestZ + 1) << kShiftZ;
};

/// No step of a neighbourhood is longer along an axis.
inline constexpr int kLargestStep_vox = 2;

/// The steps to a voxel's neighbours. 6: faces; 18: and edges; 26: and corners; 24: faces, edges,
/// and two voxels along each axis, as FIESTA is published.
[[nodiscard]] std::vector<Eigen::Vector3i> neighbourhood(int connectivity);

/// For every voxel of a grid its closest obstacle, kept up to date while obstacles come and go
/// (Han et al. 2019, "FIESTA", Alg. 2 and 3). Each obstacle heads a doubly linked list of the
/// voxels whose closest obstacle it is, so that all of them are at hand when it vanishes.
///
/// After each update no voxel could do better with the closest obstacle of any neighbour. That is
/// almost always the closest of all; see the README for how far it can be off.
///
/// `Value` holds a squared distance in voxels: std::uint16_t or std::uint32_t. One thread at a
/// time; nothing allocates once the queues have reached their size.
template <class Value>
class ClosestObstacles {
 public:
  enum class Start { kNoObstacles, kAllObstacles };

  /// Squared distances of `cap` and beyond are not told apart and read `cap`; cap >= 1.
  /// `steps` lead to a voxel's neighbours. The grid must satisfy fits().
  ClosestObstacles(const Eigen::Vector3i& size_vox, std::uint32_t cap,
                   std::span<const Eigen::Vector3i> steps, Start start);

  /// Whether indices of 32 bits and an Offset are enough for a grid and a cap.
  [[nodiscard]] static bool fits(const Eigen::Vector3i& size_vox, std::uint32_t cap) noexcept;

  /// Follows a change of the map. `removed` are obstacles so far, `inserted` are none so far; no
  /// voxel is in both.
  void update(std::span<const Eigen::Vector3i> removed, std::span<const Eigen::Vector3i> inserted);

  /// The squared distances of row (y, z).
  [[nodiscard]] const Value* row(int y, int z) const noexcept {
    return &distance2_[index(0, y, z)];
  }

  /// The squared distance that reads "none within reach".
  [[nodiscard]] std::uint32_t cap() const noexcept { return cap_; }

  /// Voxels of a row whose changes are told together; divides kBlockSide_vox.
  static constexpr int kTile_vox = 16;
  /// Calls visit(x, y, z) with the first voxel of each tile in which a distance may have changed
  /// since the call before.
  template <class Visit>
  void take_touched(Visit&& visit) {
    const int tiles_per_row = pitch_ / kTile_vox;
    for (std::size_t from = 0; from < touched_.size(); from += sizeof(std::uint64_t)) {
      std::uint64_t any;
      std::memcpy(&any, &touched_[from], sizeof any);
      if (any == 0) continue;
      for (std::size_t t = from; t < from + sizeof any; ++t) {
        if (touched_[t] == 0) continue;
        touched_[t] = 0;
        const int tile = static_cast<int>(t);
        const int row = tile / tiles_per_row;
        visit(tile % tiles_per_row * kTile_vox, row % rows_, row / rows_);
      }
    }
  }

  /// The closest obstacle of a voxel, where one is within reach.
  [[nodiscard]] std::optional<Eigen::Vector3i> closest(const Eigen::Vector3i& voxel) const;
  /// A voxel's neighbours in the list that it is in, or heads. The list is a ring that the
  /// obstacle is part of.
  [[nodiscard]] Eigen::Vector3i next(const Eigen::Vector3i& voxel) const;
  [[nodiscard]] Eigen::Vector3i previous(const Eigen::Vector3i& voxel) const;

 private:
  struct Step {
    int x, y, z;
    int index;                 ///< From a voxel to the neighbour.
    std::uint32_t difference;  ///< Of Offset::bits.
  };
  struct Link {
    std::int32_t next;
    std::int32_t previous;
  };
  struct Waiting {
    std::int32_t voxel;
    Value distance2;  ///< When it was put into the queue.
  };

  [[nodiscard]] int index(int x, int y, int z) const noexcept {
    return first_ + x + pitch_ * (y + rows_ * z);
  }
  [[nodiscard]] int index(const Eigen::Vector3i& v) const noexcept {
    return index(v.x(), v.y(), v.z());
  }
  [[nodiscard]] Eigen::Vector3i voxel(int index) const noexcept;

  void orphan_list(int obstacle);
  void insert(int obstacle);
  void adopt_orphan(int voxel);
  void propagate();
  void offer_to_neighbours(int voxel);
  void set_closest(int voxel, int obstacle, Offset offset, Value distance2);
  void unlink(int voxel) noexcept;
  void touch(int voxel) noexcept {
    touched_[static_cast<std::size_t>((voxel - first_) / kTile_vox)] = 1;
  }

  Eigen::Vector3i size_;
  std::uint32_t cap_;
  int pitch_;  ///< From row to row; ends with a border that is the next row's as well.
  int rows_;   ///< From slice to slice of constant z, in rows; likewise.
  int first_;  ///< Index of voxel (0, 0, 0).
  std::vector<Step> steps_;
  // By index. The border has distance 0 and no offset: it takes nothing and offers nothing.
  LargeArray<Value> distance2_;
  LargeArray<Offset> offset_;
  LargeArray<Link> link_;
  std::vector<std::uint8_t> touched_;  ///< By tile; a whole number of 64-bit words.
  std::vector<std::int32_t> orphans_;
  std::vector<Waiting> queue_, next_queue_;
};

extern template class ClosestObstacles<std::uint16_t>;
extern template class ClosestObstacles<std::uint32_t>;

}  // namespace sidestep::incremental
