#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>

#include "conformance/gaze_conformance.hpp"
#include "support/host_fixture.hpp"
#include "support/voxel_field.hpp"

namespace sidestep {
namespace {

using conformance::GazeCase;
using conformance::GazeConformance;
using conformance::Looker;
using ::testing::HasSubstr;
using testing_support::HostFixture;
using testing_support::VoxelWorld;

Result<std::shared_ptr<Gaze>> try_load(const std::string& block,
                                       std::shared_ptr<const RobotModel> robot) {
  const auto fixture =
      std::make_shared<HostFixture>(std::vector<std::filesystem::path>{PLUGIN_FOLDER});
  const RunLoan loan{std::move(robot), nullptr, nullptr, {}};
  auto loaded = fixture->host.create<Gaze>(HostFixture::block(block), loan);
  if (!loaded) return tl::make_unexpected(loaded.error());
  const std::shared_ptr<Gaze> gaze(std::move(*loaded));
  return std::shared_ptr<Gaze>(gaze.get(), [fixture, gaze](Gaze*) {});
}

std::shared_ptr<Gaze> load(const std::string& block, std::shared_ptr<const RobotModel> robot) {
  auto gaze = try_load(block, std::move(robot));
  if (!gaze) throw std::runtime_error(gaze.error().describe());
  return *gaze;
}

GazeCase loaded(const std::string& name, const std::string& parameters = {}) {
  return {name, [block = "{plugin: " + name + parameters + "}"](auto robot) {
            return load(block, std::move(robot));
          }};
}

INSTANTIATE_TEST_SUITE_P(plugins, GazeConformance,
                         testing::Values(loaded("fixed"), loaded("foresight"),
                                         loaded("look_ahead", ", link: base"), loaded("scan"),
                                         loaded("volumetric")),
                         [](const auto& of) { return of.param.name; });

/// A hall, 12 m x 12 m, seen but for some boxes.
std::shared_ptr<const DistanceField> hall(std::vector<testing_support::Aabb> walls,
                                          std::vector<testing_support::Aabb> unknown) {
  VoxelWorld world;
  world.grid = {{-6.0, -6.0, 0.0}, 0.1, {120, 120, 16}};
  world.occupied = std::move(walls);
  world.unknown = std::move(unknown);
  return world.field();
}

class Gazes : public ::testing::Test {
 protected:
  HeadAngles look(Gaze& gaze) { return *gaze.look(looker_.request()); }
  /// Turns the head as the gaze says, ten times a second, and takes frames.
  void follow(Gaze& gaze, double duration_s) {
    for (double t = 0.0; t < duration_s; t += 0.1) {
      const HeadAngles to = looker_.head().within_limits(look(gaze));
      looker_.at = to;
      looker_.now.ns += 100'000'000;
      looker_.take_frame();
    }
  }
  /// Whether a camera of 60 x 47 degrees that looks along the angles has a point in its image.
  bool sees(const HeadAngles& angles, const Eigen::Vector3d& p_m) const {
    const Eigen::Vector3d p =
        looker_.head().T_world_camera(angles, looker_.T_world_link).inverse() * p_m;
    return p.z() > 0.0 && std::abs(p.x()) < 0.577 * p.z() && std::abs(p.y()) < 0.433 * p.z();
  }

  Looker looker_;
};

TEST_F(Gazes, FixedStaysWhereItIsToldAndElseAtRest) {
  const HeadAngles rest = look(*load("{plugin: fixed}", looker_.robot()));
  EXPECT_EQ(rest.pan_rad, 0.0);
  EXPECT_EQ(rest.tilt_rad, 0.0);
  const HeadAngles told = look(*load("{plugin: fixed, tilt_rad: -0.4}", looker_.robot()));
  EXPECT_EQ(told.pan_rad, 0.0);
  EXPECT_EQ(told.tilt_rad, -0.4);
}

TEST_F(Gazes, ScanPansFromSideToSide) {
  const auto gaze =
      load("{plugin: scan, speed_radps: 0.5, reach_rad: 1.0, tilt_rad: -0.6}", looker_.robot());
  for (int i = 0; i <= 80; ++i) {
    // From the middle to the left in 2 s, to the right in 4 s more, and back.
    const double t = 0.1 * i;
    const double expected = t <= 2.0 ? 0.5 * t : t <= 6.0 ? 2.0 - 0.5 * t : 0.5 * t - 4.0;
    const HeadAngles angles = look(*gaze);
    EXPECT_NEAR(angles.pan_rad, expected, 1e-9) << t;
    EXPECT_EQ(angles.tilt_rad, -0.6);
    looker_.now.ns += 100'000'000;
  }
}

TEST_F(Gazes, LookAheadLooksAtWhereALinkWillBe) {
  const auto gaze = load("{plugin: look_ahead, link: base, ahead_s: 2.0}", looker_.robot());
  looker_.drive_to(Eigen::Vector2d(2.0, 2.0), 4.0);
  HeadAngles angles = look(*gaze);  // at (1, 1, 0), from 1 m above (0, 0, 0)
  EXPECT_NEAR(angles.pan_rad, std::atan2(1.0, 1.0), 1e-6);
  EXPECT_NEAR(angles.tilt_rad, -std::atan2(1.0, std::sqrt(2.0)), 1e-6);
  // At its end it turns on to where it was told last, and stays there.
  const HeadAngles told = angles;
  looker_.at = {0.3, -0.2};
  looker_.stand(Eigen::Vector2d(2.0, 2.0));
  looker_.way = straight_line(looker_.state, looker_.state, 2, 0.1);
  angles = look(*gaze);
  EXPECT_EQ(angles.pan_rad, told.pan_rad);
  EXPECT_EQ(angles.tilt_rad, told.tilt_rad);
}

TEST_F(Gazes, LookAheadNeedsALinkOfTheRobot) {
  const auto gaze = try_load("{plugin: look_ahead, link: bse}", looker_.robot());
  ASSERT_FALSE(gaze);
  EXPECT_THAT(gaze.error().describe(),
              HasSubstr("robot 'looker' has no link 'bse' (did you mean 'base'?)"));
}

class Weighing : public Gazes, public ::testing::WithParamInterface<const char*> {
 protected:
  std::shared_ptr<Gaze> gaze_ = load(std::string("{plugin: ") + GetParam() + "}", looker_.robot());
};

TEST_P(Weighing, LooksAtWhatIsUnseenOnTheWay) {
  looker_.field = hall({}, {{{1.4, 1.4, 0.0}, {2.6, 2.6, 1.0}}});
  looker_.drive_to(Eigen::Vector2d(4.0, 4.0), 12.0);
  looker_.take_frame();
  bool has_looked = false;
  for (int i = 0; i < 10 && !has_looked; ++i) {
    follow(*gaze_, 0.1);
    has_looked = sees(looker_.at, {1.8, 1.8, 0.2});
  }
  EXPECT_TRUE(has_looked) << looker_.at.pan_rad << " " << looker_.at.tilt_rad;
}

TEST_P(Weighing, LooksElsewhereWhereWhatItLooksAtStaysUnseen) {
  // Whatever the camera does there: nothing comes back of it.
  looker_.field =
      hall({}, {{{0.9, -2.6, 0.0}, {1.6, -0.5, 1.0}}, {{0.9, 0.5, 0.0}, {1.6, 2.6, 1.0}}});
  looker_.way = Trajectory();
  looker_.drive_to(Eigen::Vector2d(1.2, 2.4), 8.0);
  looker_.take_frame();
  bool is_left = false, is_elsewhere = false;
  for (int i = 0; i < 40; ++i) {
    follow(*gaze_, 0.1);
    (sees(looker_.at, {1.2, 1.8, 0.2}) ? is_left : is_elsewhere) = true;
  }
  EXPECT_TRUE(is_left);
  if (std::string(GetParam()) == "foresight") {
    EXPECT_TRUE(is_elsewhere);
  }
}

INSTANTIATE_TEST_SUITE_P(gazes, Weighing, testing::Values("volumetric", "foresight"),
                         [](const auto& of) { return std::string(of.param); });

TEST_F(Gazes, ForesightLooksAfterWhoWasLostBesideIt) {
  looker_.field = hall({}, {});
  const auto gaze = load("{plugin: foresight}", looker_.robot());
  looker_.take_frame();
  follow(*gaze, 6.0);  // all around is known by now
  Track track;
  track.id = 1;
  track.position_m = {0.8, -1.3};
  track.radius_m = 0.3;
  track.top_m = 1.8;
  track.last_seen = {looker_.now.ns - 1'500'000'000};
  looker_.tracks = Tracks{{track}, looker_.now};
  EXPECT_TRUE(sees(look(*gaze), {0.8, -1.3, 0.9}));
}

TEST_F(Gazes, ForesightLooksAtWhatMovedAndIsOutOfView) {
  looker_.field = hall({}, {});
  const auto gaze = load("{plugin: foresight}", looker_.robot());
  looker_.take_frame();
  follow(*gaze, 6.0);
  looker_.moving =
      MovingObstacles{{{{0.8, 1.3, 0.9}, 0.2, Stamp{looker_.now.ns - 1'000'000'000}}}, looker_.now};
  EXPECT_TRUE(sees(look(*gaze), {0.8, 1.3, 0.9}));
}

TEST_F(Gazes, ForesightLooksAtWhatBlocksTheWayLaterOn) {
  // A bend to the left, blocked at its end: else all of it would be too far off to matter.
  const auto looks_there = [&](bool is_blocked) {
    looker_ = Looker();
    looker_.field = hall({}, {});
    const auto gaze = load("{plugin: foresight, around_weight: 0.0}", looker_.robot());
    looker_.drive_to(Eigen::Vector2d(0.0, 2.5), 40.0);
    if (is_blocked) looker_.blocked_s = 39.0;
    looker_.take_frame();
    for (int i = 0; i < 20; ++i) {
      follow(*gaze, 0.1);
      if (sees(looker_.at, {0.0, 2.4, 0.2})) return true;
    }
    return false;
  };
  EXPECT_TRUE(looks_there(true));
  EXPECT_FALSE(looks_there(false));
}

TEST_F(Gazes, ForesightLooksAtWhatStandsBesideTheRobotWhereItsWayIsBlocked) {
  // A post to its left; the way leads straight on.
  const auto looks_there = [&](bool is_blocked) {
    looker_ = Looker();
    looker_.field = hall({{{-0.1, 0.25, 0.0}, {0.1, 0.45, 0.5}}}, {});
    const auto gaze = load("{plugin: foresight, around_weight: 0.0}", looker_.robot());
    looker_.drive_to(Eigen::Vector2d(2.5, 0.0), 10.0);
    if (is_blocked) looker_.blocked_s = 0.0;
    looker_.take_frame();
    for (int i = 0; i < 20; ++i) {
      follow(*gaze, 0.1);
      if (sees(looker_.at, {0.0, 0.3, 0.4})) return true;
    }
    return false;
  };
  EXPECT_TRUE(looks_there(true));
  EXPECT_FALSE(looks_there(false));
}

TEST_F(Gazes, ForesightLooksAroundWhileNothingElseIsToBeSeen) {
  looker_.field = hall({}, {});
  const auto gaze = load("{plugin: foresight}", looker_.robot());
  looker_.take_frame();
  double least = 0.0, most = 0.0;
  for (int i = 0; i < 100; ++i) {
    follow(*gaze, 0.1);
    least = std::min(least, looker_.at.pan_rad);
    most = std::max(most, looker_.at.pan_rad);
  }
  EXPECT_LT(least, -1.0);
  EXPECT_GT(most, 1.0);
}

}  // namespace
}  // namespace sidestep
