#pragma once

#include <optional>
#include <string>
#include <vector>

#include <sidestep/experiments/experiment.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/results_store.hpp>

namespace sidestep {

/// What a planner made of one problem.
struct SetSolve {
  std::string family;
  int index = 0;
  bool is_found = false;     ///< It gave a trajectory, which it holds for valid.
  bool is_smooth = false;    ///< And it does not stop on its way.
  double time_ms = 0.0;      ///< Until it did.
  double path_length = 0.0;  ///< In the space of joints, rad and m alike.
  double duration_s = 0.0;
  double clearance_m = 0.0;  ///< By the independent check.
  std::string refusal;       ///< Why the independent check refuses it; empty where it does not.
  std::string reason;        ///< Why there is none.
  std::string seed;

  [[nodiscard]] bool is_solved() const noexcept { return is_found && refusal.empty(); }
};

struct PlannerRecord {
  std::string name;
  std::string checker;
  std::vector<SetSolve> solves;
};

struct PlannerBenchmarkRecord {
  std::string type;
  std::string problems;
  std::string robot;
  std::vector<PlannerRecord> planners;
  bool interrupted = false;
};

/// Verdict, summary.json and tables of a finished (or interrupted) planner benchmark.
[[nodiscard]] ExperimentOutcome summarise_planners(const RunProvenance& provenance,
                                                   const PlannerBenchmarkRecord& record);

}  // namespace sidestep
