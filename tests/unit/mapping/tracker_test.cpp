#include <algorithm>
#include <numbers>
#include <set>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include <sidestep/mapping/tracker.hpp>

#include "people_world.hpp"

namespace sidestep {
namespace {

using testing_support::PeopleMap;
using testing_support::PeopleWorld;
using testing_support::Walk;

const Track* nearest_to(const Tracks& tracks, const Eigen::Vector2d& p, double within_m = 0.4) {
  const Track* nearest = nullptr;
  for (const Track& track : tracks.tracks) {
    const double distance_m = (track.position_m - p).norm();
    if (distance_m > within_m) continue;
    within_m = distance_m;
    nearest = &track;
  }
  return nearest;
}

/// Maps and tracks the frames of a time, and hands what is tracked after each to `check`.
template <class Check>
void watch(PeopleWorld& world, double until_s, Check&& check) {
  PeopleMap map;
  const int last = static_cast<int>(until_s / PeopleWorld::kPeriod_s + 0.5);
  for (int number = 0; number <= last; ++number) {
    const Frame frame = world.look(number);
    (void)map.integrate(frame);
    check(frame.stamp.seconds(), *map.track(frame));
  }
}

class WalkerAt : public testing::TestWithParam<std::tuple<double, bool>> {};

TEST_P(WalkerAt, IsFoundWhereItIsAsFastAndAsLargeAsItIs) {
  const auto [speed_mps, across] = GetParam();
  const double way_m = across ? 3.4 : 2.8;
  const double begin_s = 2.0, end_s = begin_s + way_m / speed_mps;
  PeopleWorld world({across ? Walk{{{begin_s, 3.2, -1.7}, {end_s, 3.2, 1.7}}}
                            : Walk{{{begin_s, 4.2, 0.4}, {end_s, 1.4, -0.2}}}});
  double worst_m = 0.0, sum_mps = 0.0;
  int frames = 0, found = 0;
  watch(world, end_s, [&](double time_s, const Tracks& tracks) {
    // Who leaves the place where they stood may be taken for two for a moment.
    if (time_s < begin_s || time_s > begin_s + 1.1) {
      EXPECT_LE(tracks.tracks.size(), 1U) << time_s;
    }
    // From when it has moved by its own width: the map knew it as a thing that stands.
    const double moved_m = speed_mps * (time_s - begin_s);
    if (moved_m < 0.7 || time_s - begin_s < 1.0 || moved_m > way_m - 0.2) return;
    ++frames;
    const Track* track = nearest_to(tracks, world.position_m(0, time_s));
    if (track == nullptr) return;
    ++found;
    worst_m = std::max(worst_m, (track->position_m - world.position_m(0, time_s)).norm());
    sum_mps += (track->velocity_mps - world.velocity_mps(0, time_s)).norm();
    EXPECT_NEAR(track->radius_m, PeopleWorld::kRadius_m, 0.1) << time_s;
    EXPECT_NEAR(track->bottom_m, 0.05, 0.1) << time_s;
    EXPECT_EQ(track->last_seen, tracks.stamp);
    EXPECT_LT(track->first_seen, tracks.stamp);
  });
  ASSERT_GT(frames, 5);
  EXPECT_EQ(found, frames);
  EXPECT_LE(worst_m, 0.15);
  EXPECT_LE(sum_mps / found, 0.15 + 0.1 * speed_mps);
}
INSTANTIATE_TEST_SUITE_P(Speeds, WalkerAt,
                         testing::Combine(testing::Values(0.3, 0.8, 1.2, 1.6), testing::Bool()));

TEST(Tracker, KeepsTheIdsOfPeopleWhoCross) {
  // One behind the other for a moment.
  PeopleWorld world({{{{1.0, 2.6, -2.0}, {6.0, 2.6, 2.0}}}, {{{1.0, 3.6, 2.2}, {6.0, 3.6, -2.2}}}});
  std::vector<std::set<std::int64_t>> ids(2);
  watch(world, 5.5, [&](double time_s, const Tracks& tracks) {
    if (time_s < 2.2) return;
    for (std::size_t person : {0U, 1U}) {
      const Track* track = nearest_to(tracks, world.position_m(person, time_s));
      ids[person].insert(track != nullptr ? track->id : 0);
    }
    EXPECT_EQ(tracks.tracks.size(), 2U) << time_s;
  });
  EXPECT_EQ(ids[0].size(), 1U);
  EXPECT_EQ(ids[1].size(), 1U);
  EXPECT_NE(ids[0], ids[1]);
  EXPECT_FALSE(ids[0].contains(0) || ids[1].contains(0));
}

TEST(Tracker, TellsPeopleApartWhoWalkSideBySide) {
  PeopleWorld world({{{{1.0, 4.2, 0.5}, {4.0, 1.8, 0.5}}}, {{{1.0, 4.2, -0.3}, {4.0, 1.8, -0.3}}}});
  watch(world, 4.0, [&](double time_s, const Tracks& tracks) {
    if (time_s < 2.6) return;
    ASSERT_EQ(tracks.tracks.size(), 2U) << time_s;
    for (std::size_t person : {0U, 1U}) {
      EXPECT_NE(nearest_to(tracks, world.position_m(person, time_s), 0.2), nullptr)
          << person << " at " << time_s;
    }
  });
}

TEST(Tracker, KeepsTheIdOfOneWhoIsHiddenForASecond) {
  // Behind a pillar at 1.2 m/s, which hides 1.7 m of the way of somebody half a metre wide.
  PeopleWorld world({{{{1.0, 3.6, -2.2}, {4.6, 3.6, 2.12}}}},
                    {PeopleWorld::box({1.8, 0.0, 1.25}, {0.1, 0.83, 2.5})});
  int hidden = 0;
  std::set<std::int64_t> ids;
  watch(world, 4.4, [&](double time_s, const Tracks& tracks) {
    if (time_s < 2.0) return;
    const Track* track = nearest_to(tracks, world.position_m(0, time_s));
    ids.insert(track != nullptr ? track->id : 0);
    hidden += track != nullptr && track->last_seen < tracks.stamp ? 1 : 0;
  });
  EXPECT_EQ(ids.size(), 1U);
  EXPECT_FALSE(ids.contains(0));
  EXPECT_GE(hidden * PeopleWorld::kPeriod_s, 0.9);
}

TEST(Tracker, ForgetsOneWhoWalksAwayBehindSomething) {
  PeopleWorld world({{{{1.0, 3.6, -2.2}, {3.2, 3.6, 0.0}, {9.0, 3.6, 0.01}}}},
                    {PeopleWorld::box({1.8, 0.5, 1.25}, {0.1, 1.6, 2.5})});
  std::size_t tracked = 0;
  watch(world, 6.0, [&](double time_s, const Tracks& tracks) {
    if (time_s > 2.0 && time_s < 2.8) tracked += tracks.tracks.size();
    if (time_s > 4.5) {
      EXPECT_TRUE(tracks.tracks.empty()) << time_s;
    }
  });
  EXPECT_GT(tracked, 0U);
}

TEST(Tracker, KeepsOneWhoStopsSeenOrNotUntilTheyHaveGone) {
  // Walks, stands for 12 s, and is gone from one frame to the next. From 6 to 9 s the camera looks
  // elsewhere.
  PeopleWorld world({{{{1.0, 4.5, 0.8}, {4.0, 3.0, 0.2}, {16.0, 3.0, 0.2}, {16.05, -9.0, 0.2}}}});
  world.yaw_rad = [](double time_s) { return time_s > 6.0 && time_s < 9.0 ? -1.5 : 0.0; };
  std::set<std::int64_t> ids;
  watch(world, 18.0, [&](double time_s, const Tracks& tracks) {
    if (time_s > 17.5) {
      EXPECT_TRUE(tracks.tracks.empty()) << time_s;
    }
    if (time_s < 3.0 || time_s > 16.0) return;
    ASSERT_EQ(tracks.tracks.size(), 1U) << time_s;
    const Track& track = tracks.tracks.front();
    ids.insert(track.id);
    if (time_s < 5.0) return;
    EXPECT_LT((track.position_m - world.position_m(0, time_s)).norm(), 0.15) << time_s;
    EXPECT_LT(track.velocity_mps.norm(), 0.1) << time_s;
    EXPECT_EQ(track.last_seen<tracks.stamp, time_s> 6.05 && time_s < 8.95) << time_s;
  });
  EXPECT_EQ(ids.size(), 1U);
}

TEST(Tracker, LeavesOneWhoStandsForLongToTheMapUntilTheyWalkOn) {
  PeopleWorld world({{{{1.0, 4.2, 0.8}, {2.5, 3.0, 0.2}, {40.0, 3.0, 0.2}, {41.5, 3.0, -1.4}}}});
  std::set<std::int64_t> before, after;
  watch(world, 41.5, [&](double time_s, const Tracks& tracks) {
    if (time_s > 2.5 && time_s < 30.0) {
      ASSERT_EQ(tracks.tracks.size(), 1U) << time_s;
      before.insert(tracks.tracks.front().id);
    }
    if (time_s > 36.0 && time_s < 40.0) {
      EXPECT_TRUE(tracks.tracks.empty()) << time_s;
    }
    if (time_s < 41.0) return;
    ASSERT_EQ(tracks.tracks.size(), 1U) << time_s;
    after.insert(tracks.tracks.front().id);
  });
  EXPECT_EQ(before.size(), 1U);
  EXPECT_EQ(after.size(), 1U);
  EXPECT_NE(before, after);
}

TEST(Tracker, IsLessSureOfOneWhoIsHiddenWithEveryFrame) {
  PeopleWorld world({{{{1.0, 3.6, -2.2}, {5.4, 3.6, 2.2}}}},
                    {PeopleWorld::box({1.8, 0.0, 1.25}, {0.1, 0.6, 2.5})});
  Eigen::Matrix4d before = Eigen::Matrix4d::Zero();
  int hidden = 0;
  watch(world, 5.2, [&](double, const Tracks& tracks) {
    for (const Track& track : tracks.tracks) {
      if (track.last_seen < tracks.stamp) {
        ++hidden;
        for (int i = 0; i < 4; ++i) EXPECT_GT(track.covariance(i, i), before(i, i));
      }
      EXPECT_EQ(track.covariance.llt().info(), Eigen::Success);
      before = track.covariance;
    }
  });
  EXPECT_GE(hidden, 3);
}

TEST(Tracker, TakesWhatComesIntoViewForNoThing) {
  PeopleWorld world({}, {PeopleWorld::box({2.5, 1.5, 0.4}, {0.8, 0.8, 0.8}),
                         PeopleWorld::box({3.0, -1.0, 0.9}, {0.3, 0.3, 1.8})});
  world.yaw_rad = [](double time_s) {
    return 1.2 * std::sin(2.0 * std::numbers::pi * time_s / 6.0);
  };
  watch(world, 12.0,
        [&](double time_s, const Tracks& tracks) { EXPECT_TRUE(tracks.tracks.empty()) << time_s; });
}

TEST(Tracker, TakesWhatComesIntoRangeForNoThing) {
  // Drives at 0.2 m/s towards a wall that is 5.6 m away at first, past others, and looks about.
  PeopleWorld world({}, {PeopleWorld::box({4.0, 1.5, 0.4}, {0.8, 0.8, 0.8})});
  world.camera_m = [](double time_s) { return Eigen::Vector3d(-0.9 + 0.2 * time_s, 0.0, 1.1); };
  world.yaw_rad = [](double time_s) {
    return 0.5 * std::sin(2.0 * std::numbers::pi * time_s / 8.0);
  };
  watch(world, 12.0,
        [&](double time_s, const Tracks& tracks) { EXPECT_TRUE(tracks.tracks.empty()) << time_s; });
}

TEST(Tracker, IsTheSameForTheSameFrames) {
  const std::vector<Walk> walks = {{{{0.5, 4.5, 1.0}, {5.0, 2.0, -1.0}}}};
  PeopleWorld world(walks), again(walks);
  std::vector<Eigen::Vector4d> first, second;
  const auto note = [](std::vector<Eigen::Vector4d>& into) {
    return [&](double, const Tracks& tracks) {
      for (const Track& track : tracks.tracks) {
        into.emplace_back(track.position_m.x(), track.position_m.y(), track.velocity_mps.x(),
                          static_cast<double>(track.id));
      }
    };
  };
  watch(world, 4.0, note(first));
  watch(again, 4.0, note(second));
  EXPECT_FALSE(first.empty());
  EXPECT_EQ(first, second);
}

}  // namespace
}  // namespace sidestep
