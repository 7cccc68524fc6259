#include "episode_progress.hpp"

#include <utility>

#include <sidestep/core/format.hpp>

namespace sidestep {
namespace {

constexpr auto kTellEvery = std::chrono::seconds(5);

}  // namespace

EpisodeProgress::EpisodeProgress(Tell tell, Stamp begin, double duration_s, Wall::time_point wall)
    : tell_(std::move(tell)),
      begin_(begin),
      limit_(format(" s of at most %g s", duration_s)),
      told_(wall) {}

void EpisodeProgress::note(Stamp now, Wall::time_point wall) {
  if (!tell_ || wall - told_ < kTellEvery) return;
  told_ = wall;
  tell_(format("%.0f", now.seconds() - begin_.seconds()) + limit_);
}

}  // namespace sidestep
