#include "frame_drops.hpp"

namespace sidestep::ros1_source {

void FrameDrops::add(const std::string& kind, const std::string& reason) {
  ++counts_[kind];
  ++total_;
  ++untold_;
  const double now_s = time_s_();
  if (told_s_ && now_s - *told_s_ < 1.0) return;
  log_.warn("source ros1: dropped " + std::to_string(untold_) +
            (untold_ == 1 ? " frame: " : " frames, the last: ") + reason);
  untold_ = 0;
  told_s_ = now_s;
}

std::string FrameDrops::describe() const {
  std::string text = std::to_string(total_) + (total_ == 1 ? " frame" : " frames") + " dropped";
  const char* separator = ": ";
  for (const auto& [kind, count] : counts_) {
    text += separator + std::to_string(count) + " " + kind;
    separator = ", ";
  }
  return text;
}

}  // namespace sidestep::ros1_source
