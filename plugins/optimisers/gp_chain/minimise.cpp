#include "minimise.hpp"

namespace sidestep {

Minimisation minimise(ChainModel& model, StepRule& rule, const StoppingRules& stop,
                      const Deadline& deadline) {
  using End = Minimisation::End;
  Minimisation result;
  const auto ended = [&result](End end) {
    result.end = end;
    return result;
  };
  rule.reset(model.current().support.size());
  while (result.accepted < stop.max_iterations) {
    if (deadline.expired()) return ended(End::kDeadline);
    const double before = model.current().cost;
    model.linearise();
    switch (rule.iterate(model, deadline, result.tried)) {
      case StepOutcome::kNoBetter: return ended(End::kConverged);
      case StepOutcome::kSingular: return ended(End::kSingular);
      case StepOutcome::kInterrupted: return ended(End::kDeadline);
      case StepOutcome::kAccepted: break;
    }
    ++result.accepted;
    result.last_decrease = before - model.current().cost;
    if (result.last_decrease <= stop.absolute_tolerance ||
        result.last_decrease <= stop.relative_tolerance * before) {
      return ended(End::kConverged);
    }
  }
  return ended(End::kIterationLimit);
}

}  // namespace sidestep
