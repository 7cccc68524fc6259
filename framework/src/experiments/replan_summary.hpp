#pragma once

#include <sidestep/experiments/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "replan_rows.hpp"

namespace sidestep {

/// What a replan experiment is, beyond its rows.
struct ReplanFacts {
  RunProvenance provenance;
  std::string clock;
  std::string robot;
  std::string optimiser;  ///< Name of the plugin.
  int planned_episodes = 0;
  bool interrupted = false;
  std::optional<Error> fault;  ///< That ended it early.
};

/// Verdict, summary.json and table of a finished (or interrupted) replan experiment.
[[nodiscard]] ExperimentOutcome summarise_replan(const ReplanFacts& facts, const ReplanRows& rows);

}  // namespace sidestep
