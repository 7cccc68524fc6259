#include <sidestep/planning/motion_check.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/field/scene_field.hpp>

#include "clearance_prover.hpp"
#include "edge_prover.hpp"

namespace sidestep {
namespace {

constexpr double kFirstStep_m = 0.1;

class StraightMotion final : public Motion {
 public:
  StraightMotion(std::span<const double> from, std::span<const double> to) : from_(from), to_(to) {}
  void configuration(double t, std::span<double> q) const override {
    for (std::size_t j = 0; j < q.size(); ++j) {
      q[j] = t == 1.0 ? to_[j] : from_[j] + t * (to_[j] - from_[j]);
    }
  }
  void variation(double from, double to, std::span<double> v) const override {
    for (std::size_t j = 0; j < v.size(); ++j) v[j] = (to - from) * std::abs(to_[j] - from_[j]);
  }

 private:
  std::span<const double> from_;
  std::span<const double> to_;
};

/// Ends the proof at the first thing that speaks against the motion.
class FirstObjection final : public ClearanceProver::Listener {
 public:
  explicit FirstObjection(const ClearanceProver& prover) : prover_(prover) {}
  bool on_reading(double, int item, const ClearanceReading& reading) override {
    return !prover_.violates(item, reading);
  }
  bool on_unproven(double, int, const Shortfall&) override { return false; }

 private:
  const ClearanceProver& prover_;
};

}  // namespace

struct MotionCheck::Impl {
  /// For fields in general.
  struct Voxels {
    Voxels(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const MotionBounds> bounds,
           std::shared_ptr<const DistanceField> field, SpacePolicy space, double margin_m)
        : prover(std::move(robot), std::move(bounds), std::move(field), std::move(space), margin_m),
          workspace(prover.make_workspace()),
          readings(idx(prover.item_count())) {}

    [[nodiscard]] bool is_clear(std::span<const double> q) {
      prover.read(q, readings, *workspace);
      for (int item = 0; item < prover.item_count(); ++item) {
        if (prover.violates(item, readings[idx(item)])) return false;
      }
      return true;
    }
    [[nodiscard]] bool is_clear(std::span<const double> q_from, std::span<const double> q_to,
                                double resolution_m) {
      const StraightMotion motion(q_from, q_to);
      FirstObjection objection(prover);
      const ClearanceProver::Request request{motion, 0.0, 1.0, kFirstStep_m, resolution_m};
      return prover.prove(request, objection, Deadline(), *workspace) ==
             ClearanceProver::End::kFinished;
    }

    ClearanceProver prover;
    ClearanceProver::WorkspacePtr workspace;
    std::vector<ClearanceReading> readings;
  };

  explicit Impl(std::shared_ptr<const RobotModel> of)
      : robot(std::move(of)), bounds(std::make_shared<const MotionBounds>(*robot)) {}

  std::shared_ptr<const RobotModel> robot;
  std::shared_ptr<const MotionBounds> bounds;
  std::optional<EdgeProver> edges;  ///< Among shapes.
  std::optional<Voxels> voxels;     ///< Otherwise; one of the two is there.
  bool is_among_shapes = false;
};

MotionCheck::MotionCheck(std::shared_ptr<const RobotModel> robot,
                         std::shared_ptr<const DistanceField> field, SpacePolicy space,
                         double margin_m)
    : impl_(std::make_unique<Impl>(std::move(robot))) {
  look_at(std::move(field), std::move(space), margin_m);
}
MotionCheck::~MotionCheck() = default;
MotionCheck::MotionCheck(MotionCheck&&) noexcept = default;
MotionCheck& MotionCheck::operator=(MotionCheck&&) noexcept = default;

void MotionCheck::look_at(std::shared_ptr<const DistanceField> field, SpacePolicy space,
                          double margin_m) {
  auto scene = std::dynamic_pointer_cast<const SceneField>(field);
  impl_->is_among_shapes = scene != nullptr;
  if (scene == nullptr) {
    impl_->voxels.emplace(impl_->robot, impl_->bounds, std::move(field), std::move(space),
                          margin_m);
    return;
  }
  if (!impl_->edges) impl_->edges.emplace(impl_->robot, impl_->bounds);
  impl_->edges->look_at(std::move(scene), space, margin_m);
}

bool MotionCheck::is_clear(std::span<const double> q) {
  return impl_->is_among_shapes ? impl_->edges->is_clear(q) : impl_->voxels->is_clear(q);
}

unsigned MotionCheck::find_blocked(std::span<const double> q) {
  const bool is_finite = std::ranges::all_of(q, [](double value) { return std::isfinite(value); });
  if (impl_->is_among_shapes && is_finite) return impl_->edges->find_blocked(q);
  const std::size_t dof = impl_->robot->description().joints.size();
  unsigned blocked = 0;
  for (std::size_t i = 0; i < q.size() / dof; ++i) {
    if (!is_clear(q.subspan(i * dof, dof))) blocked |= 1u << i;
  }
  return blocked;
}

bool MotionCheck::is_clear(std::span<const double> q_from, std::span<const double> q_to,
                           double resolution_m) {
  return impl_->is_among_shapes ? impl_->edges->is_clear(q_from, q_to, resolution_m)
                                : impl_->voxels->is_clear(q_from, q_to, resolution_m);
}

}  // namespace sidestep
