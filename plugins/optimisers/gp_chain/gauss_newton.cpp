#include "step_rules.hpp"

namespace sidestep {
namespace {

class GaussNewton final : public StepRule {
 public:
  void reset(std::size_t variables) override { step_.assign(variables, 0.0); }

  [[nodiscard]] StepOutcome iterate(ChainModel& model, const Deadline&, int& tried) override {
    ++tried;
    if (!model.system().solve(0.0, step_)) return StepOutcome::kSingular;
    const double before = model.current().cost;
    if (!(model.try_step(step_, before) < before)) return StepOutcome::kNoBetter;
    model.accept();
    return StepOutcome::kAccepted;
  }

 private:
  std::vector<double> step_;
};

}  // namespace

std::unique_ptr<StepRule> make_gauss_newton() { return std::make_unique<GaussNewton>(); }

}  // namespace sidestep
