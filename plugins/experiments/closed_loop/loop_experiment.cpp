#include "loop_experiment.hpp"

#include <sidestep/runtime/checked_robot.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include "replan_summary.hpp"
#include "replan_world.hpp"

namespace sidestep {

ExperimentFacts LoopExperiment::facts() const {
  // A replan's first guesses are `replanner.escalation`, and what it finds is timed anew always.
  // The robot looks on while it moves.
  return {.blocks = {"robot", "source", "mapper", "field", "optimiser", "planning", "executor",
                     "replanner"},
          .optional_blocks = {"check", "sampler"},
          .unused_of_planning = {"max_unknown_share", "retime", "attempts"}};
}

const report::RunReport& LoopExperiment::report() const { return replan_report(); }

void check_loop(const Configuration& configuration, Host& host, const CheckOwn& check_own,
                std::vector<Error>& errors) {
  const auto robot = checked_robot(configuration, host, errors);
  if (robot == nullptr) return;
  check_own(robot, errors);
  check_allowed_contacts(block_of(configuration, "check"), robot->description(), nullptr, errors);
  check_floor(block_of(configuration, "planning"), robot->description(), errors);
}

Result<ExperimentOutcome> run_loop(const ExperimentContext& context, ReplanFacts facts,
                                   const std::string& identity,
                                   const std::function<Result<void>(Recorder& recorder)>& work) {
  const auto file = context.out / "results.sqlite";
  auto store = SIDESTEP_TRY(context.resume ? ResultsStore::reopen(file)
                                           : ResultsStore::open(file, facts.provenance));
  Recorder recorder(*store);
  if (!context.resume) record_replan_run(identity, recorder);
  SIDESTEP_TRY(recorder.commit());
  // Held here, so that episodes before one that cannot be run are kept.
  auto done = contained("the closed loop", [&] { return work(recorder); });
  store.reset();
  // One without end is ended by a stop, and not interrupted.
  facts.interrupted = context.stop.stop_requested() && facts.planned_episodes > 0;
  return conclude_replan(std::move(facts), std::move(done), file);
}

}  // namespace sidestep
