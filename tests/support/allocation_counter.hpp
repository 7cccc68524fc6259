#pragma once

namespace sidestep::testing_support {

/// How often this thread, in a test whose sources include allocation_counter.cpp, has asked
/// operator new for memory.
[[nodiscard]] int allocations() noexcept;

}  // namespace sidestep::testing_support
