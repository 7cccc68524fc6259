#include "conformance/optimiser_conformance.hpp"

#include "conformance/test_host.hpp"
#include "rrt_connect.hpp"

namespace sidestep::conformance {
namespace {

class WithLog final : public Optimiser {
 public:
  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                       const Deadline& deadline) override {
    return optimiser_->solve(problem, initial, deadline);
  }

 private:
  RecordingLog log_;
  std::unique_ptr<Optimiser> optimiser_ = rrt_connect::make_rrt_connect({}, 7, log_);
};

OptimiserCase rrt_connect_case() {
  OptimiserCase c;
  c.name = "rrt_connect";
  c.make = [] { return std::make_unique<WithLog>(); };
  c.minimises_cost = false;
  return c;
}

INSTANTIATE_TEST_SUITE_P(RrtConnect, OptimiserConformance, testing::Values(rrt_connect_case()),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
