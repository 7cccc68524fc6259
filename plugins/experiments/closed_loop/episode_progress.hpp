#pragma once

#include <chrono>
#include <functional>
#include <string>

#include <sidestep/core/time.hpp>

namespace sidestep {

/// Tells people how far an episode has come, every few seconds of the wall's clock while it goes
/// on: by that clock one may take minutes. One thread.
class EpisodeProgress {
 public:
  using Wall = std::chrono::steady_clock;
  using Tell = std::function<void(const std::string& how_far)>;

  /// Of an episode that begins now, at `begin` of its own clock, and lasts `duration_s` at most.
  /// `tell` may be empty.
  EpisodeProgress(Tell tell, Stamp begin, double duration_s, Wall::time_point wall = Wall::now());

  /// After each step, the last one included.
  void note(Stamp now, Wall::time_point wall = Wall::now());

 private:
  Tell tell_;
  Stamp begin_;
  std::string limit_;
  Wall::time_point told_;
};

}  // namespace sidestep
