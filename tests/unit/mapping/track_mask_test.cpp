#include <algorithm>
#include <map>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/mapping/track_mask.hpp>

#include "conformance/grid_map.hpp"
#include "conformance/map_bits.hpp"
#include "edt_field.hpp"
#include "people_world.hpp"

namespace sidestep {
namespace {

using conformance::GridMap;
using testing_support::PeopleMap;
using testing_support::PeopleWorld;

TEST(TrackMask, ClaimsACylinderButNothingThatWasThereBefore) {
  GridMap map({{-1.0, -1.0, 0.0}, 0.05, {130, 60, 40}});
  const auto fill = [&](const Eigen::Vector3d& low_m, const Eigen::Vector3d& high_m) {
    const Eigen::Vector3i low = map.grid().voxel_at(low_m), high = map.grid().voxel_at(high_m);
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int x = low.x(); x <= high.x(); ++x) map.set({x, y, z}, true);
      }
    }
  };
  TrackMask mask(1.5);
  fill({1.8, -0.5, 0.68}, {2.6, 0.5, 0.71});  // a table
  for (const double time_s : {0.0, 1.6, 3.2}) {
    mask.begin(map, Stamp::from_seconds(time_s));
    mask.end({});
  }
  EXPECT_TRUE(mask.is_settled_near({2.2, 0.0, 0.76})) << "beside the table";
  EXPECT_FALSE(mask.is_settled_near({2.2, 0.0, 0.83}));
  fill({2.1, -0.1, 0.76}, {2.3, 0.1, 1.1});  // something put down on it, across a word's end
  mask.begin(map, Stamp::from_seconds(3.3));
  Track track;
  track.position_m = {2.2, 0.0};
  track.radius_m = 0.15;
  track.bottom_m = 0.9;
  track.top_m = 1.0;
  const TrackMask::Extent extent = mask.claim(track, true);
  EXPECT_NEAR(extent.bottom_m, 0.75, 1e-9);
  EXPECT_NEAR(extent.top_m, 1.15, 0.051);
  mask.end({});
  MaskedOccupancy masked(map, map);
  MapUpdate update;
  masked.apply(mask.mask(), update);
  double farthest_m = 0.0;
  int claimed = 0;
  for (int z = 0; z < 40; ++z) {
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 130; ++x) {
        const Eigen::Vector3d p = map.grid().centre_m({x, y, z});
        const bool is_thing = map.occupied().at(map.grid(), {x, y, z}) && p.z() > 0.75;
        // Within the cylinder, wider by a voxel and a half.
        const bool is_near = (p.head<2>() - track.position_m).norm() < 0.15 + 0.075;
        const bool is_left = masked.occupied().at(map.grid(), {x, y, z});
        EXPECT_EQ(is_left, map.occupied().at(map.grid(), {x, y, z}) && !(is_thing && is_near))
            << p.transpose();
        if (!is_thing || !is_near) continue;
        ++claimed;
        farthest_m = std::max(farthest_m, (p.head<2>() - track.position_m).norm());
      }
    }
  }
  EXPECT_EQ(extent.voxels, claimed);
  EXPECT_LE(farthest_m, mask.reach_m(track));
  // What nothing claims, and no frame sees through, is an obstacle again.
  mask.begin(map, Stamp::from_seconds(3.4));
  mask.end({});
  masked.apply(mask.mask(), update);
  EXPECT_TRUE(std::ranges::equal(masked.occupied().words, map.occupied().words));
}

TEST(TrackMask, ClaimsWhatPeopleLeftInsideTheRobotButNothingThatStoodThere) {
  GridMap map({{-1.0, -1.0, 0.0}, 0.05, {130, 60, 40}});
  const Eigen::Vector3d centre_m(2.2, 0.1, 0.9);
  const double radius_m = 0.3;
  const auto fill = [&](double first_x_m, double last_x_m) {
    for (int z = 0; z < 40; ++z) {
      for (int y = 0; y < 60; ++y) {
        for (int x = 0; x < 130; ++x) {
          const double x_m = map.grid().centre_m({x, y, z}).x();
          if (x_m > first_x_m && x_m < last_x_m) map.set({x, y, z}, true);
        }
      }
    }
  };
  TrackMask mask(1.5);
  MaskedOccupancy masked(map, map);
  fill(2.3, 2.4);  // a wall
  for (const double time_s : {0.0, 1.6, 3.2}) {
    mask.begin(map, Stamp::from_seconds(time_s));
    mask.end({});
  }
  fill(1.9, 2.3);
  mask.begin(map, Stamp::from_seconds(3.3));
  mask.claim_ball(centre_m, radius_m);
  mask.end({});
  MapUpdate update = map.take_update();
  masked.apply(mask.mask(), update);
  int hidden = 0;
  for (int z = 0; z < 40; ++z) {
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 130; ++x) {
        const Eigen::Vector3d p = map.grid().centre_m({x, y, z});
        const bool is_hidden = map.occupied().at(map.grid(), {x, y, z}) &&
                               !masked.occupied().at(map.grid(), {x, y, z});
        EXPECT_EQ(is_hidden, p.x() > 1.9 && p.x() < 2.3 && (p - centre_m).norm() < radius_m)
            << p.transpose();
        hidden += is_hidden ? 1 : 0;
      }
    }
  }
  EXPECT_GT(hidden, 300);
}

TEST(MaskedOccupancy, TellsEveryBlockThatDiffers) {
  GridMap map({{0.0, 0.0, 0.0}, 0.1, {70, 40, 24}});
  std::mt19937 random(3);
  const auto any_voxel = [&]() -> Eigen::Vector3i {
    return {std::uniform_int_distribution(0, 69)(random),
            std::uniform_int_distribution(0, 39)(random),
            std::uniform_int_distribution(0, 23)(random)};
  };
  for (int i = 0; i < 3000; ++i) map.set(any_voxel(), true);
  MaskedOccupancy masked(map, map);
  std::map<std::size_t, MaskedWord> words;
  for (int step = 0; step < 30; ++step) {
    const auto before = conformance::copy_bits(masked);
    std::erase_if(words, [](const auto& entry) { return entry.second.now == 0; });
    for (auto& [w, word] : words) {
      word.before = word.now;
      if (random() % 2 == 0) word.now = 0;
    }
    for (int i = 0; i < 40 * (step % 3); ++i) {
      const auto w =
          std::uniform_int_distribution<std::size_t>(0, map.occupied().words.size() - 1)(random);
      words.try_emplace(w, MaskedWord{w, 0, 0}).first->second.now = random();
    }
    std::vector<std::uint64_t> mask(map.occupied().words.size(), 0);
    std::vector<MaskedWord> list;
    for (const auto& [w, word] : words) {
      mask[w] = word.now;
      list.push_back(word);
    }
    std::ranges::shuffle(list, random);
    if (step % 2 == 0) {
      for (int i = 0; i < 20; ++i) map.set(any_voxel(), random() % 2 == 0);
    }
    MapUpdate update = map.take_update();
    masked.apply(list, update);
    const auto after = conformance::copy_bits(masked);
    for (std::size_t w = 0; w < mask.size(); ++w) {
      ASSERT_EQ(after.occupied[w], map.occupied().words[w] & ~mask[w]);
    }
    EXPECT_TRUE(std::ranges::is_sorted(update.changed_blocks));
    EXPECT_TRUE(std::ranges::includes(update.changed_blocks,
                                      conformance::differing_blocks(map.grid(), before, after)));
  }
}

/// A hall that has been mapped for two seconds before somebody walks through it at 1.1 m/s, stands
/// for ten seconds, and walks on.
class MaskedHall : public testing::Test {
 protected:
  static constexpr double kStands_s = 4.3, kWalksOn_s = 14.3, kEnd_s = 16.0;
  PeopleWorld world_{{{{{2.0, 3.6, 7.0},
                        {2.05, 3.6, 1.8},
                        {kStands_s, 2.6, -0.4},
                        {kWalksOn_s, 2.6, -0.4},
                        {kEnd_s, 4.2, -1.4}}}}};
  PeopleMap people_;
  MaskedOccupancy masked_{people_.map(), people_.map()};

  /// Frame by frame: what is tracked then, and the update for a field of the masked map.
  template <class Check>
  void watch(double until_s, Check&& check) {
    for (int number = 0; number * PeopleWorld::kPeriod_s <= until_s; ++number) {
      const Frame frame = world_.look(number);
      MapUpdate update = people_.integrate(frame);
      const auto tracks = people_.track(frame);
      masked_.apply(people_.tracker.mask(), update);
      check(frame, *tracks, update);
    }
  }
  /// Hands every voxel that is occupied in the map to `check`, and whether the mask leaves it.
  template <class Check>
  void for_each_occupied(Check&& check) {
    const GridSpec& grid = masked_.occupancy_grid();
    for (int z = 0; z < grid.size_vox.z(); ++z) {
      for (int y = 0; y < grid.size_vox.y(); ++y) {
        for (int x = 0; x < grid.size_vox.x(); ++x) {
          const Eigen::Vector3i voxel(x, y, z);
          const bool is_left = masked_.occupied().at(grid, voxel);
          const bool is_occupied = people_.map().occupied().at(grid, voxel);
          EXPECT_LE(is_left, is_occupied);
          if (is_occupied) check(grid.centre_m(voxel), is_left);
        }
      }
    }
  }
};

TEST_F(MaskedHall, HidesNothingThatIsNotInATrackOrTrulyFree) {
  int hidden = 0, trail = 0;
  watch(kEnd_s, [&](const Frame& frame, const Tracks& tracks, const MapUpdate&) {
    const double time_s = frame.stamp.seconds();
    for_each_occupied([&](const Eigen::Vector3d& p, bool is_left) {
      if (is_left) return;
      ++hidden;
      const bool is_in_a_track = std::ranges::any_of(tracks.tracks, [&](const Track& track) {
        return (p.head<2>() - track.position_m).norm() <= track.radius_m + 1e-9 &&
               p.z() >= track.bottom_m && p.z() <= track.top_m;
      });
      if (is_in_a_track) return;
      ++trail;
      // Nothing is in the middle of the voxel.
      const double half_edge_m = 0.5 * masked_.occupancy_grid().resolution_m;
      EXPECT_GT(world_.scene().signed_distance(p, time_s).distance_m, half_edge_m)
          << p.transpose() << " at " << time_s;
    });
  });
  EXPECT_GT(hidden, 10000);
  EXPECT_GT(trail, 100);
}

TEST_F(MaskedHall, LeavesNothingOfWhoIsTrackedWhereTheCameraSees) {
  int frames = 0;
  watch(kEnd_s, [&](const Frame& frame, const Tracks& tracks, const MapUpdate&) {
    const double time_s = frame.stamp.seconds();
    if (time_s < 2.8) return;
    ASSERT_EQ(tracks.tracks.size(), 1U) << time_s;
    const Eigen::Vector2d person_m = world_.position_m(0, time_s);
    int body = 0, body_left = 0, behind = 0;
    for_each_occupied([&](const Eigen::Vector3d& p, bool is_left) {
      const double beside_m = (p.head<2>() - person_m).norm() - PeopleWorld::kRadius_m;
      body += beside_m < 0.05 ? 1 : 0;
      body_left += beside_m < 0.05 && is_left ? 1 : 0;
      // Not the noise of what stands.
      behind += is_left && beside_m > 0.2 && world_.sees_beyond(frame, p) ? 1 : 0;
    });
    EXPECT_LE(body_left, 0.03 * body) << time_s;
    EXPECT_LE(behind, 3) << time_s;
    ++frames;
  });
  EXPECT_GT(frames, 100);
}

TEST_F(MaskedHall, FieldsThatFollowTheMaskAreExact) {
  conformance::TestHost host(1);
  const edt::Options options{true, 0.8, "free"};
  const auto builder = edt::make_edt_builder(options, host.workers());
  ASSERT_TRUE(builder->attach(masked_));
  watch(6.0, [&](const Frame& frame, const Tracks& tracks, const MapUpdate& update) {
    const auto field = builder->update(update).value();
    if (tracks.tracks.empty() || update.sequence % 10 != 0) return;
    // One that knows nothing of updates, of a copy of the masked map.
    GridMap copy(masked_.occupancy_grid());
    for (int z = 0; z < copy.grid().size_vox.z(); ++z) {
      for (int y = 0; y < copy.grid().size_vox.y(); ++y) {
        for (int x = 0; x < copy.grid().size_vox.x(); ++x) {
          copy.set({x, y, z}, masked_.occupied().at(copy.grid(), {x, y, z}));
        }
      }
    }
    const auto anew = edt::make_edt_builder(options, host.workers());
    ASSERT_TRUE(anew->attach(copy));
    const auto expected = anew->update(copy.take_update()).value();
    std::vector<Eigen::Vector3d> points;
    for (int z = 0; z < copy.grid().size_vox.z(); z += 3) {
      for (int y = 0; y < copy.grid().size_vox.y(); ++y) {
        for (int x = 0; x < copy.grid().size_vox.x(); ++x) {
          points.push_back(copy.grid().centre_m({x, y, z}));
        }
      }
    }
    std::vector<double> distances(points.size()), wanted(points.size());
    std::vector<Eigen::Vector3d> gradients(points.size());
    std::vector<FieldStatus> statuses(points.size());
    field->query(points, distances, gradients, statuses);
    expected->query(points, wanted, gradients, statuses);
    EXPECT_EQ(distances, wanted) << frame.stamp.seconds();
  });
}

}  // namespace
}  // namespace sidestep
