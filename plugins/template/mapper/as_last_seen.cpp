// A mapper: a voxel is what the newest frame that has seen it says. It forgets at once what has
// gone, and believes a frame that is wrong until the next one: noise stays in the map.

#include "as_last_seen.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/mapping/frame_check.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/ray_ends.hpp>
#include <sidestep/mapping/self_filter.hpp>

namespace as_last_seen {
namespace {

using namespace sidestep;

class AsLastSeen final : public Mapper, public OccupancyView {
 public:
  AsLastSeen(const Options& options, std::shared_ptr<const RobotModel> robot)
      : options_(options),
        grid_(options.grid()),
        rules_(options.rules()),
        words_per_row_((grid_.size_vox.x() + 63) / 64),
        self_(std::move(robot), options.self_filter_margin_m) {
    const std::size_t words =
        idx(words_per_row_) * idx(grid_.size_vox.y()) * idx(grid_.size_vox.z());
    for (auto* bits : {&occupied_, &known_, &hit_, &seen_}) bits->assign(words, 0);
  }

  Result<MapUpdate> integrate(const Frame& frame) override {
    // All that may fail, before anything of the map changes.
    SIDESTEP_TRY(check_frame(frame));
    SIDESTEP_TRY(self_.pose(frame));
    MapUpdate update{.sequence = ++sequence_, .stamp = frame.stamp};
    std::ranges::fill(hit_, 0);
    std::ranges::fill(seen_, 0);
    const RayEnds ends(grid_, rules_, options_.clear_no_return, self_, frame);
    for (std::size_t i = 0; i < ends.size(); ++i) {
      if (const auto end = ends.at(i, update.counts)) follow(ends.camera_vox(), *end);
    }
    update.changed_blocks = take_over();
    return update;
  }

  const GridSpec& grid() const noexcept override { return grid_; }

  const GridSpec& occupancy_grid() const noexcept override { return grid_; }
  VoxelBits occupied() const noexcept override { return {occupied_, words_per_row_}; }
  VoxelBits known() const noexcept override { return {known_, words_per_row_}; }

 private:
  using Bits = std::vector<std::uint64_t>;

  /// Marks what a ray goes through, in steps of half a voxel, which may miss a corner.
  void follow(const Eigen::Vector3d& from, const RayEnd& end) {
    const Eigen::Vector3d way = end.p_vox - from;
    const double step = 0.5 / way.norm();
    if (const auto inside = clip_to_box(from, end.p_vox, grid_.size_vox.cast<double>())) {
      for (double at = inside->enter; at < inside->leave; at += step) mark(from + at * way, seen_);
    }
    mark(end.p_vox, seen_);
    if (end.hit) mark(end.p_vox, hit_);
  }

  void mark(const Eigen::Vector3d& p_vox, Bits& bits) const {
    const Eigen::Vector3i voxel = nearest_voxel(grid_, p_vox);
    const int row = voxel.y() + grid_.size_vox.y() * voxel.z();
    bits[idx(row * words_per_row_ + voxel.x() / 64)] |= std::uint64_t{1} << (voxel.x() % 64);
  }

  /// The frame's marks into the map, where a hit outdoes the rays that pass. Names the blocks in
  /// which a bit is another now: no more, for fields work for each, and no fewer.
  std::vector<std::int32_t> take_over() {
    const Eigen::Vector3i counts = block_counts(grid_);
    std::vector<char> is_changed(idx(counts.prod()));
    for (int w = 0; w < std::ssize(seen_); ++w) {
      const std::size_t at = idx(w);
      const std::uint64_t occupied = (occupied_[at] & ~seen_[at]) | hit_[at];
      const std::uint64_t known = known_[at] | seen_[at];
      const std::uint64_t others = (occupied ^ occupied_[at]) | (known ^ known_[at]);
      occupied_[at] = occupied;
      known_[at] = known;
      if (others == 0) continue;
      const int row = w / words_per_row_, y = row % grid_.size_vox.y(),
                z = row / grid_.size_vox.y();
      for (int i = 0; i < 4; ++i) {  // 64 bits are 4 blocks wide
        if (((others >> (kBlockSide_vox * i)) & 0xffffU) == 0) continue;
        const Eigen::Vector3i block(4 * (w % words_per_row_) + i, y / kBlockSide_vox,
                                    z / kBlockSide_vox);
        is_changed[idx(block_linear(block, counts))] = 1;
      }
    }
    std::vector<std::int32_t> changed;
    for (std::int32_t b = 0; b < std::ssize(is_changed); ++b) {
      if (is_changed[idx(b)] != 0) changed.push_back(b);
    }
    return changed;
  }

  Options options_;
  GridSpec grid_;
  PointRules rules_;
  int words_per_row_;
  SelfFilter self_;
  Bits occupied_, known_;  ///< The map.
  Bits hit_, seen_;        ///< By this frame.
  std::int64_t sequence_ = 0;
};

}  // namespace

Result<std::unique_ptr<Mapper>> create(const Options& options, const HostContext& context) {
  return std::make_unique<AsLastSeen>(options, context.robot);
}

}  // namespace as_last_seen

SIDESTEP_PLUGIN(sidestep::Mapper, as_last_seen::Options, as_last_seen::create, "as_last_seen",
                "0.1.0", "A voxel is what the newest frame says: an example of a plugin",
                sidestep::OccupancyView)
