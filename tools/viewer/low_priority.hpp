#pragma once

namespace sidestep {

/// Lets the calling thread run only where others leave it time (nice 19, SCHED_BATCH). What the
/// system does not grant is passed over.
void lower_thread_priority() noexcept;

}  // namespace sidestep
