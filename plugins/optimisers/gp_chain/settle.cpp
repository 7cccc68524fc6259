#include "settle.hpp"

#include <algorithm>
#include <cmath>

#include "damping.hpp"

namespace sidestep {

Minimisation settle(ChainModel& model, StepRule& rule, const StoppingRules& stop,
                    const Deadline& deadline, std::vector<double>& step) {
  using End = Minimisation::End;
  Minimisation result;
  const auto ended = [&result](End end) {
    result.end = end;
    return result;
  };
  step.resize(model.current().support.size());
  while (result.accepted < stop.max_iterations) {
    if (deadline.expired()) return ended(End::kDeadline);
    const double before = model.current().cost;
    const double enough = std::max(stop.absolute_tolerance, stop.relative_tolerance * before);
    model.linearise();
    if (!model.system().solve(0.0, step)) break;
    const double predicted = model.system().predicted_decrease(0.0, step);
    if (predicted <= enough) return ended(End::kConverged);
    ++result.tried;
    const double decrease = before - model.try_step(step);
    if (!(decrease > kLeastFidelity * predicted)) {
      // Too little changes for a shorter step to be worth trying: levenberg_marquardt's rule.
      if (std::abs(decrease) < stop.relative_tolerance * before) return ended(End::kConverged);
      break;
    }
    model.accept();
    ++result.accepted;
    result.last_decrease = decrease;
    if (decrease <= enough) return ended(End::kConverged);
  }
  StoppingRules rest = stop;
  rest.max_iterations -= result.accepted;
  const Minimisation damped = minimise(model, rule, rest, deadline);
  result.end = damped.end;
  result.accepted += damped.accepted;
  result.tried += damped.tried;
  if (damped.accepted > 0) result.last_decrease = damped.last_decrease;
  return result;
}

}  // namespace sidestep
