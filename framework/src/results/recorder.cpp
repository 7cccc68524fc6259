#include <sidestep/results/recorder.hpp>

namespace sidestep {

Result<void> Recorder::commit() {
  note(store_.commit());
  if (!error_) return {};
  auto error = tl::make_unexpected(std::move(*error_));
  error_.reset();
  return error;
}

void record_bad_frames(std::span<const Error> bad_frames, Recorder& recorder) {
  for (std::size_t i = 0; i < bad_frames.size(); ++i) {
    recorder.add("bad_frame", static_cast<std::int64_t>(i), "error", bad_frames[i].describe());
  }
}

}  // namespace sidestep
