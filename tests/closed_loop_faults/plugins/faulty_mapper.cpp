// The voxel grid, with faults.
#include "fault_window.hpp"
#include "voxel_grid.hpp"

namespace sidestep::faulty {
namespace {

struct Options : FaultOptions {
  voxel_grid::VoxelGridOptions as;
  static Parameters<Options> parameters() {
    return declare_fault<Options>({"throws", "fails"})
        .add("as", &Options::as, "Parameters of what is wrapped.");
  }
  [[nodiscard]] std::vector<OptionMistake> check() const { return as.check(); }
};

class FaultyMapper final : public Mapper, public OccupancyView {
 public:
  FaultyMapper(const Options& options, const HostContext& context)
      : window_(options, context.clock), map_(options.as, context) {}

  Result<MapUpdate> integrate(const Frame& frame) override {
    window_.pass("throws");
    if (window_.has("fails")) return fail(ErrorCode::kUnsupported, "has seen enough");
    return map_.integrate(frame);
  }
  const GridSpec& grid() const noexcept override { return map_.grid(); }
  const GridSpec& occupancy_grid() const noexcept override { return map_.occupancy_grid(); }
  VoxelBits occupied() const noexcept override { return map_.occupied(); }
  VoxelBits known() const noexcept override { return map_.known(); }

 private:
  FaultWindow window_;
  voxel_grid::VoxelGrid map_;
};

Result<std::unique_ptr<Mapper>> create(const Options& options, const HostContext& context) {
  return std::make_unique<FaultyMapper>(options, context);
}

}  // namespace
}  // namespace sidestep::faulty

SIDESTEP_PLUGIN(sidestep::Mapper, sidestep::faulty::Options, sidestep::faulty::create, "faulty",
                "1", "The voxel grid, with faults", sidestep::OccupancyView)
