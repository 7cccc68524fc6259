#pragma once

#include <cstdint>

#include <sidestep/core/time.hpp>

namespace sidestep {

/// What one frame says of a fault.
enum class FaultSign : std::uint8_t { kNothing, kFault, kSound };

/// Of a fault, over frames: it is one 0.2 s and three frames after the first that showed it, and is
/// none once all frames of a second that tell have shown the opposite.
struct FaultVerdict {
  bool is_fault = false;
  Stamp since;     ///< Of the row of frames that contradict it.
  int frames = 0;  ///< In that row.

  void hear(FaultSign sign, Stamp now) noexcept {
    constexpr std::int64_t kCertain_ns = 200'000'000, kGone_ns = 1'000'000'000;
    constexpr int kCertainFrames = 3;
    if (sign == FaultSign::kNothing) return;
    if ((sign == FaultSign::kFault) == is_fault) {
      frames = 0;
      return;
    }
    if (frames == 0 || now < since) {
      frames = 0;
      since = now;
    }
    const std::int64_t least_ns = is_fault ? kGone_ns : kCertain_ns;
    if (++frames < kCertainFrames || now.ns - since.ns < least_ns) return;
    is_fault = !is_fault;
    frames = 0;
  }
};

}  // namespace sidestep
