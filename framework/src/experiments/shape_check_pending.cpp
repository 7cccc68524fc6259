// Stands in for the independent check until the runtime has it: shows nothing to be valid. Weak,
// so that the real one takes its place by being there.
#include <sidestep/runtime/shape_check.hpp>

namespace sidestep {
namespace {

class NothingShown final : public ValidityCheck {
 public:
  Result<Verdict> check(const Trajectory&, double, const Deadline&) const override {
    return Verdict{};
  }
};

}  // namespace

__attribute__((weak)) std::vector<Eigen::Vector3d> occupied_centres(const OccupancyView&) {
  return {};
}

__attribute__((weak)) Result<std::unique_ptr<ValidityCheck>> make_shape_check(
    std::shared_ptr<const RobotModel>, ShapeObstacles, ShapeCheckSettings) {
  return std::make_unique<NothingShown>();
}

}  // namespace sidestep
