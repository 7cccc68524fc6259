#include <sidestep/planning/motion_check.hpp>

#include <cmath>
#include <utility>
#include <vector>

#include "clearance_prover.hpp"

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
  Impl(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const DistanceField> field,
       SpacePolicy space, double margin_m)
      : prover(robot, std::make_shared<const MotionBounds>(*robot), std::move(field), space,
               margin_m),
        workspace(prover.make_workspace()),
        readings(static_cast<std::size_t>(prover.item_count())) {}

  ClearanceProver prover;
  ClearanceProver::WorkspacePtr workspace;
  std::vector<ClearanceReading> readings;
};

MotionCheck::MotionCheck(std::shared_ptr<const RobotModel> robot,
                         std::shared_ptr<const DistanceField> field, SpacePolicy space,
                         double margin_m)
    : impl_(std::make_unique<Impl>(std::move(robot), std::move(field), space, margin_m)) {}
MotionCheck::~MotionCheck() = default;
MotionCheck::MotionCheck(MotionCheck&&) noexcept = default;
MotionCheck& MotionCheck::operator=(MotionCheck&&) noexcept = default;

bool MotionCheck::is_clear(std::span<const double> q) {
  impl_->prover.read(q, impl_->readings, *impl_->workspace);
  for (int item = 0; item < impl_->prover.item_count(); ++item) {
    if (impl_->prover.violates(item, impl_->readings[static_cast<std::size_t>(item)])) return false;
  }
  return true;
}

bool MotionCheck::is_clear(std::span<const double> q_from, std::span<const double> q_to,
                           double resolution_m) {
  const StraightMotion motion(q_from, q_to);
  FirstObjection objection(impl_->prover);
  const ClearanceProver::Request request{motion, 0.0, 1.0, kFirstStep_m, resolution_m};
  return impl_->prover.prove(request, objection, Deadline(), *impl_->workspace) ==
         ClearanceProver::End::kFinished;
}

}  // namespace sidestep
