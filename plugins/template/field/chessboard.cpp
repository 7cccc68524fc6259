// A field: the largest of the three differences (the L-infinity metric), which is never more than
// the Euclidean distance, so planning with it is on the safe side. Two sweeps over the grid
// (Rosenfeld and Pfaltz, 1968).

#include "chessboard.hpp"

#include <algorithm>
#include <optional>
#include <vector>

#include <sidestep/mapping/dense_field_publisher.hpp>

namespace chessboard {
namespace {

using namespace sidestep;

class ChessboardBuilder final : public FieldBuilder {
 public:
  ChessboardBuilder(const Options& options, WorkerPool& workers)
      : options_(options), workers_(workers) {}

  Result<void> attach(Mapper& mapper) override {
    // What a mapper offers beyond integrate() is asked for by type.
    view_ = dynamic_cast<const OccupancyView*>(&mapper);
    if (view_ == nullptr) {
      return fail(ErrorCode::kUnsupported, "the mapper offers no OccupancyView",
                  "field chessboard");
    }
    grid_ = view_->occupancy_grid();
    publisher_.emplace(FieldInfo{.grid = grid_, .max_distance_m = options_.max_distance_m}, *view_,
                       workers_);
    return {};
  }

  Result<std::shared_ptr<const DistanceField>> update(const MapUpdate& update) override {
    if (!publisher_) {
      return fail(ErrorCode::kInvalidArgument, "update() before attach()", "field chessboard");
    }
    auto changed = SIDESTEP_TRY(publisher_->begin(update));
    sweep();
    // Every block is offered; the publisher shares those that come out equal.
    std::ranges::fill(changed, std::uint8_t{1});
    return publisher_->publish(
        update, changed, [this](int x, int y, int z, int count, float* distances_m) {
          for (int i = 0; i < count; ++i) {
            const double chessboard_m = grid_.resolution_m * steps_[grid_.linear({x + i, y, z})];
            distances_m[i] = static_cast<float>(
                std::clamp(chessboard_m - options_.inflation_m, 0.0, options_.max_distance_m));
          }
        });
  }

 private:
  void sweep() {
    const int far = grid_.size_vox.maxCoeff();
    steps_.assign(grid_.voxel_count(), far);
    const VoxelBits occupied = view_->occupied();
    for (const bool forward : {true, false}) {
      for (int n = 0; n < grid_.size_vox.prod(); ++n) {
        const int at = forward ? n : grid_.size_vox.prod() - 1 - n;
        const Eigen::Vector3i voxel(at % grid_.size_vox.x(),
                                    at / grid_.size_vox.x() % grid_.size_vox.y(),
                                    at / (grid_.size_vox.x() * grid_.size_vox.y()));
        relax(voxel, occupied);
      }
    }
  }

  /// One more than the nearest neighbour, or 0 in an obstacle.
  void relax(const Eigen::Vector3i& voxel, const VoxelBits& occupied) {
    int& steps = steps_[grid_.linear(voxel)];
    if (occupied.at(grid_, voxel)) steps = 0;
    for (int i = 0; i < 27; ++i) {
      const Eigen::Vector3i neighbour =
          voxel + Eigen::Vector3i(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
      if (grid_.contains(neighbour)) steps = std::min(steps, steps_[grid_.linear(neighbour)] + 1);
    }
  }

  Options options_;
  WorkerPool& workers_;
  const OccupancyView* view_ = nullptr;
  GridSpec grid_;
  std::vector<int> steps_;
  std::optional<DenseFieldPublisher> publisher_;
};

}  // namespace

Result<std::unique_ptr<FieldBuilder>> create(const Options& options, const HostContext& context) {
  return std::make_unique<ChessboardBuilder>(options, context.workers);
}

}  // namespace chessboard

SIDESTEP_PLUGIN(sidestep::FieldBuilder, chessboard::Options, chessboard::create, "chessboard",
                "0.1.0", "Chessboard distance, a lower bound of the Euclidean one",
                sidestep::OccupancyView)
