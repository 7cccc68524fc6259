#include "incremental_settings.hpp"

namespace sidestep {
namespace {

constexpr const char* kIncremental = "incremental";

}  // namespace

std::vector<std::string> set_of_incremental_optimiser() {
  std::vector<std::string> names = set_of_optimiser();
  names.emplace_back(kIncremental);
  return names;
}

Node incremental_block(const Node& optimiser, const RecordedRun& run, bool is_incremental) {
  Node block = block_for(optimiser, run);
  const SourceMark mark{"the experiment incremental_benchmark", 0, 0};
  block.entries().push_back(
      {kIncremental, mark, Node(Node::Scalar{is_incremental ? "true" : "false", false}, mark)});
  return block;
}

Parameters<IncrementalSettings> IncrementalSettings::parameters() {
  using S = IncrementalSettings;
  return declare_choice(experiment_parameters<S>(
                            "Seed of everything random in the run: what goals and boxes move by.",
                            "Threads that the optimiser may use; 0 for one per core."))
      .add("goal_sd", &S::goal_sd,
           "Standard deviation of what each joint of a changed goal moves by (m, rad), within its "
           "limits.",
           {.min = 0.0, .max = 10.0})
      .add("obstacle_sd_m", &S::obstacle_sd_m,
           "Standard deviation of what each box of a changed scene moves by along each axis.",
           {.unit = "m", .min = 0.0, .max = 10.0});
}

}  // namespace sidestep
