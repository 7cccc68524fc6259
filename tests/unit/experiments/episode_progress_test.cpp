#include "closed_loop.hpp"

#include <gtest/gtest.h>

namespace sidestep {
namespace {

using std::chrono::milliseconds;
using Wall = EpisodeProgress::Wall;

struct Told {
  std::vector<std::string> texts;
  EpisodeProgress::Tell tell = [this](const std::string& how_far) { texts.push_back(how_far); };
};

TEST(EpisodeProgress, IsToldEveryFiveSecondsWhileAnEpisodeGoesOn) {
  const Wall::time_point begin;
  Told told;
  EpisodeProgress progress(told.tell, Stamp::from_seconds(100.0), 90.0, begin);
  for (int step = 0; step * 4 < 16'000; ++step) {
    progress.note(Stamp::from_seconds(100.0 + 0.004 * step), begin + milliseconds(4 * step));
  }
  EXPECT_EQ(told.texts, (std::vector<std::string>{"5 s of at most 90 s", "10 s of at most 90 s",
                                                  "15 s of at most 90 s"}));
}

TEST(EpisodeProgress, CountsByTheEpisodesClockAndWaitsByTheWalls) {
  const Wall::time_point begin;
  Told told;
  EpisodeProgress progress(told.tell, Stamp{}, 7.5, begin);
  // Lockstep, faster than the wall's clock: over before there is anything to tell.
  progress.note(Stamp::from_seconds(7.5), begin + milliseconds(300));
  EXPECT_TRUE(told.texts.empty());
  // And slower: one step took that long.
  progress.note(Stamp::from_seconds(2.0), begin + milliseconds(60'000));
  EXPECT_EQ(told.texts, (std::vector<std::string>{"2 s of at most 7.5 s"}));
}

TEST(EpisodeProgress, NeedsNobodyToTell) {
  const Wall::time_point begin;
  EpisodeProgress progress({}, Stamp{}, 10.0, begin);
  progress.note(Stamp::from_seconds(9.0), begin + milliseconds(9'000));
}

}  // namespace
}  // namespace sidestep
