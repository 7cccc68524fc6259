#pragma once

namespace sidestep::testing_robot {

/// How often this thread has asked operator new for memory.
[[nodiscard]] int allocations() noexcept;

}  // namespace sidestep::testing_robot
