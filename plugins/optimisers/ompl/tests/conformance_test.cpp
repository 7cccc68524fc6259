#include "conformance/optimiser_conformance.hpp"

#include "conformance/test_host.hpp"
#include "ompl_optimiser.hpp"

namespace sidestep::conformance {
namespace {

class WithLog final : public Optimiser {
 public:
  explicit WithLog(const ompl_optimiser::Options& options)
      : optimiser_(ompl_optimiser::make_ompl_optimiser(options, 7, log_)) {}
  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                       const Deadline& deadline) override {
    return optimiser_->solve(problem, initial, deadline);
  }

 private:
  RecordingLog log_;
  std::unique_ptr<Optimiser> optimiser_;
};

OptimiserCase planner(const char* name) {
  OptimiserCase c;
  c.name = name;
  c.make = [name] {
    ompl_optimiser::Options options;
    options.planner = name;
    options.max_time_s = 60.0;  // ends by iterations, so that it repeats itself
    options.optimise_iterations = 500;
    return std::make_unique<WithLog>(options);
  };
  c.minimises_cost = false;
  return c;
}

INSTANTIATE_TEST_SUITE_P(Ompl, OptimiserConformance,
                         testing::Values(planner("RRTConnect"), planner("RRTstar"),
                                         planner("BITstar"), planner("PRM")),
                         [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
