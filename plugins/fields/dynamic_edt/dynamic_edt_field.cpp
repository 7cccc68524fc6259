#include "dynamic_edt_field.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <dynamicEDT3D/dynamicEDTOctomap.h>

#include <sidestep/mapping/dense_field_publisher.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/octree_view.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::dynamic_edt {
namespace {

octomap::point3d to_octomap(const Eigen::Vector3d& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}

class DynamicEdtBuilder final : public FieldBuilder {
 public:
  DynamicEdtBuilder(const Options& options, WorkerPool& workers)
      : options_(options), workers_(workers) {}

  Result<void> attach(Mapper& mapper) override {
    auto* octree_view = dynamic_cast<OctreeView*>(&mapper);
    const auto* occupancy_view = dynamic_cast<const OccupancyView*>(&mapper);
    if (octree_view == nullptr || occupancy_view == nullptr) {
      return fail(ErrorCode::kUnsupported,
                  octree_view == nullptr ? "the mapper offers no OctreeView"
                                         : "the mapper offers no OccupancyView",
                  "field dynamic_edt");
    }
    octomap::OcTree& tree = octree_view->octree();
    const GridSpec& grid = occupancy_view->occupancy_grid();
    SIDESTEP_TRY(check_alignment(tree, grid));
    const Eigen::Vector3i last = grid.size_vox - Eigen::Vector3i::Ones();
    first_key_ = tree.coordToKey(to_octomap(grid.centre_m(Eigen::Vector3i::Zero())));
    transform_.emplace(static_cast<float>(options_.max_distance_m), &tree,
                       to_octomap(grid.centre_m(Eigen::Vector3i::Zero())),
                       to_octomap(grid.centre_m(last)), options_.unknown == "occupied");
    publisher_.emplace(FieldInfo{.grid = grid, .max_distance_m = options_.max_distance_m},
                       *occupancy_view, workers_);
    return {};
  }

  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate& update) override {
    if (!publisher_) {
      return fail(ErrorCode::kInvalidArgument, "update() before attach()", "field dynamic_edt");
    }
    const auto named = SIDESTEP_TRY(publisher_->begin(update));
    transform_->update();
    const auto changed = within_reach(named);
    const auto limit = static_cast<float>(options_.max_distance_m);
    return publisher_->publish(
        update, changed, [&](int x, int y, int z, int count, float* distances_m) {
          octomap::OcTreeKey key(static_cast<octomap::key_type>(first_key_[0] + x),
                                 static_cast<octomap::key_type>(first_key_[1] + y),
                                 static_cast<octomap::key_type>(first_key_[2] + z));
          for (int i = 0; i < count; ++i, ++key[0]) {
            distances_m[i] = std::min(limit, transform_->getDistance_unsafe(key));
          }
        });
  }

 private:
  /// The tree's leaves must be the grid's voxels.
  static Result<void> check_alignment(const octomap::OcTree& tree, const GridSpec& grid) {
    const double tolerance_m = 1e-3 * grid.resolution_m;
    const Eigen::Vector3d centre = grid.centre_m(Eigen::Vector3i::Zero());
    octomap::OcTreeKey key;
    const bool inside = tree.coordToKeyChecked(to_octomap(centre), key);
    const octomap::point3d leaf = inside ? tree.keyToCoord(key) : octomap::point3d();
    const Eigen::Vector3d off = centre - Eigen::Vector3d(leaf.x(), leaf.y(), leaf.z());
    if (!inside || std::abs(tree.getResolution() - grid.resolution_m) > 1e-9 ||
        off.cwiseAbs().maxCoeff() > tolerance_m) {
      return fail(ErrorCode::kUnsupported, "the octree's leaves are not the voxels of the grid",
                  "field dynamic_edt", "make the grid's origin a multiple of its resolution");
    }
    return {};
  }

  /// All blocks in which a distance may have changed when `changed` blocks did.
  std::vector<std::uint8_t> within_reach(const std::vector<std::uint8_t>& changed) const {
    const Eigen::Vector3i counts = block_counts(publisher_->grid());
    const int reach = static_cast<int>(
        std::ceil(options_.max_distance_m / (publisher_->grid().resolution_m * kBlockSide_vox)));
    std::vector<std::uint8_t> wide = changed;
    for (int axis = 0; axis < 3; ++axis) {
      const int stride = axis == 0 ? 1 : axis == 1 ? counts.x() : counts.x() * counts.y();
      std::vector<std::uint8_t> narrow = wide;
      for (int b = 0; b < static_cast<int>(narrow.size()); ++b) {
        if (narrow[static_cast<std::size_t>(b)] == 0) continue;
        const int at = b / stride % counts[axis];
        const int from = std::max(-reach, -at);
        const int to = std::min(reach, counts[axis] - 1 - at);
        for (int d = from; d <= to; ++d) wide[static_cast<std::size_t>(b + d * stride)] = 1;
      }
    }
    return wide;
  }

  Options options_;
  WorkerPool& workers_;
  octomap::OcTreeKey first_key_;
  std::optional<DynamicEDTOctomap> transform_;
  std::optional<DenseFieldPublisher> publisher_;
};

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext& context) {
  return make_dynamic_edt_builder(options, context.workers);
}

}  // namespace

std::unique_ptr<FieldBuilder> make_dynamic_edt_builder(const Options& options,
                                                       WorkerPool& workers) {
  return std::make_unique<DynamicEdtBuilder>(options, workers);
}

}  // namespace sidestep::dynamic_edt

SIDESTEP_PLUGIN(sidestep::FieldBuilder, sidestep::dynamic_edt::Options,
                sidestep::dynamic_edt::create, "dynamic_edt", "0.1.0",
                "Distances by dynamicEDT3D (Lau 2010) on an OctoMap", sidestep::OccupancyView,
                sidestep::OctreeView)
