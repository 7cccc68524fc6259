#pragma once

#include <sidestep/core/export.hpp>

namespace sidestep {

/// Lets the calling thread run where others leave it time (SCHED_BATCH): with nice 19 hardly at all
/// on a machine that is busy. What the system does not grant is passed over.
SIDESTEP_EXPORT void lower_thread_priority(int nice = 19) noexcept;

}  // namespace sidestep
