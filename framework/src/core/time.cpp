#include <sidestep/core/time.hpp>

#include <algorithm>
#include <limits>

namespace sidestep {

double Deadline::remaining_s() const noexcept {
  if (stop_.stop_requested()) return 0.0;
  if (!at_) return std::numeric_limits<double>::infinity();
  return std::max(0.0, std::chrono::duration<double>(*at_ - SteadyClock::now()).count());
}

}  // namespace sidestep
