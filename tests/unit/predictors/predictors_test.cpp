#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include <sidestep/core/format.hpp>
#include <sidestep/field/scene_field.hpp>

#include "conformance/predictor_conformance.hpp"
#include "predictor_loader.hpp"

namespace sidestep {
namespace {

using conformance::kTracked;
using conformance::track_at;
using conformance::walking_people;
using testing_support::HostFixture;
using testing_support::load_predictor;

Prediction predicted(const std::string& block, const PredictionRequest& request) {
  auto prediction = load_predictor(block)->predict(request);
  if (!prediction) throw std::runtime_error(prediction.error().describe());
  return *std::move(prediction);
}

/// Signed distance of a point at a height of 1 m to the prediction.
double distance_m(const Prediction& prediction, double time_s, const Eigen::Vector2d& p_m) {
  const Eigen::Vector3d point(p_m.x(), p_m.y(), 1.0);
  double distance = 0.0;
  prediction.query(time_s, {&point, 1}, {&distance, 1}, {});
  return distance;
}

/// Where a set's centre is, by its knots.
Eigen::Vector2d centre_m(const PredictedSet& set, double time_s) {
  for (std::size_t k = 1; k < set.knots.size(); ++k) {
    const auto &a = set.knots[k - 1], &b = set.knots[k];
    if (time_s > b.time_s) continue;
    const double share = (time_s - a.time_s) / (b.time_s - a.time_s);
    return (1.0 - share) * a.centre_m + share * b.centre_m;
  }
  return set.knots.back().centre_m;
}

double largest_deviation(const Eigen::Matrix2d& covariance) {
  return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(covariance).eigenvalues()[1]);
}

TEST(WorstCase, HoldsWhereverSomebodyCouldWalkSinceLastSeen) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> angle(0.0, 6.283), time(0.0, 5.0), share(0.0, 1.0);
  for (const Track& track : walking_people(6, 7).tracks) {
    const Tracks alone{{track}, kTracked};
    const Prediction prediction =
        predicted("{plugin: worst_case, speed_mps: 1.2, sigmas: 2}", {alone, 5.0});
    const double spread_m = 2.0 * largest_deviation(track.covariance.topLeftCorner<2, 2>());
    const double unseen_s = kTracked.seconds() - track.last_seen.seconds();
    for (int i = 0; i < 400; ++i) {
      const double time_s = time(random), turned_s = unseen_s * share(random);
      const auto along = [&](double way_m) {
        const double a = angle(random);
        return Eigen::Vector2d(way_m * std::cos(a), way_m * std::sin(a));
      };
      // Went on as he was last seen for a while, and then at 1.2 m/s in any direction.
      const Eigen::Vector2d p_m = track.position_m - turned_s * track.velocity_mps +
                                  along(1.2 * (turned_s + time_s)) + along(spread_m) +
                                  along(track.radius_m);
      EXPECT_LT(distance_m(prediction, time_s, p_m), 1e-9);
    }
    if (unseen_s > 0.0) continue;
    for (int i = 0; i < 50; ++i) {  // and nothing else
      const double time_s = time(random), a = angle(random);
      const double reach_m = track.radius_m + spread_m + 1.2 * time_s + 0.3;
      const Eigen::Vector2d p_m =
          track.position_m + reach_m * Eigen::Vector2d(std::cos(a), std::sin(a));
      EXPECT_NEAR(distance_m(prediction, time_s, p_m), 0.3, 1e-9);
    }
  }
}

TEST(ConstantVelocity, GoesStraightAndWidensWithThePropagatedCovariance) {
  const Tracks people = walking_people(8, 8);
  const Prediction prediction = predicted(
      "{plugin: constant_velocity, step_s: 0.5, sigmas: 1.5, acceleration_noise: 0.2, "
      "max_growth_m: 0.6}",
      {people, 4.0});
  ASSERT_EQ(prediction.sets().size(), people.tracks.size());
  int bounded = 0, growing = 0;
  for (std::size_t i = 0; i < people.tracks.size(); ++i) {
    const Track& track = people.tracks[i];
    const PredictedSet& set = prediction.sets()[i];
    EXPECT_EQ(set.top_m, track.top_m);
    for (const double time_s : {0.0, 0.3, 1.7, 4.0}) {
      EXPECT_LT((centre_m(set, time_s) - track.position_m - time_s * track.velocity_mps).norm(),
                1e-12);
    }
    // The state of a walker pushed about, in steps of 1 ms.
    constexpr double kStep_s = 1e-3;
    Eigen::Matrix4d F = Eigen::Matrix4d::Identity(), noise = Eigen::Matrix4d::Zero();
    F.topRightCorner<2, 2>() = kStep_s * Eigen::Matrix2d::Identity();
    noise.bottomRightCorner<2, 2>() = 0.04 * kStep_s * Eigen::Matrix2d::Identity();
    Eigen::Matrix4d covariance = track.covariance;
    const double at_first_m = 1.5 * largest_deviation(covariance.topLeftCorner<2, 2>());
    std::size_t knot = 0;
    for (int ms = 0; ms <= 4000; ++ms) {
      if (ms % 500 == 0) {
        const double now_m = 1.5 * largest_deviation(covariance.topLeftCorner<2, 2>());
        const double growth_m = std::clamp(now_m - at_first_m, 0.0, 0.6);
        ++(growth_m == 0.6 ? bounded : growing);
        EXPECT_NEAR(set.knots[knot].time_s, 1e-3 * ms, 1e-12);
        EXPECT_NEAR(set.knots[knot++].radius_m, track.radius_m + at_first_m + growth_m, 2e-3);
      }
      covariance = F * covariance * F.transpose() + noise;
    }
  }
  EXPECT_GT(bounded, 5);
  EXPECT_GT(growing, 5);
}

/// A wall at x = 2 m, behind it nothing, and a floor.
class BeforeAWall : public testing::Test {
 protected:
  static Scene wall_and_floor() {
    SceneObject wall, floor;
    wall.name = "wall";
    wall.shape = Box{{0.4, 40.0, 3.0}};
    Transform pose = Transform::Identity();
    pose.translation() = Eigen::Vector3d(2.2, 0.0, 1.5);
    wall.waypoints = {{0.0, pose}};
    floor.name = "floor";
    floor.shape = HalfSpace{};
    floor.waypoints = {{0.0, Transform::Identity()}};
    return Scene({wall, floor});
  }

  /// The paths of one walker of radius 0.3 m.
  static std::vector<PredictedSet> walks(const std::string& block, const Eigen::Vector2d& from_m,
                                         const Eigen::Vector2d& velocity_mps, double horizon_s) {
    const SceneField field(wall_and_floor(), {},
                           {Eigen::Vector3d(-30.0, -30.0, -1.0), Eigen::Vector3d(30.0, 30.0, 4.0)});
    const Tracks walker{{track_at(4, from_m, velocity_mps)}, kTracked};
    PredictionRequest request{walker, horizon_s};
    request.field = &field;
    return predicted(block, request).sets();
  }
  static PredictedSet walk(const std::string& block, const Eigen::Vector2d& from_m,
                           const Eigen::Vector2d& velocity_mps, double horizon_s) {
    return walks(block, from_m, velocity_mps, horizon_s).at(0);
  }
};

TEST_F(BeforeAWall, MotionPatternsGoOnOrTurnBack) {
  const auto sets = walks("{plugin: motion_patterns, turning_m: 0.6}", {0.0, 0.5}, {0.7, 0.0}, 6.0);
  ASSERT_EQ(sets.size(), 2u);
  for (const double time_s : {0.0, 1.0, 3.0, 6.0}) {
    EXPECT_NEAR(centre_m(sets[0], time_s).x(), 0.7 * time_s, 1e-9);
    // It turns 0.6 m before the wall, looked for every 0.1 m.
    const double x_m = 1.4 - std::abs(0.7 * time_s - 1.4);
    EXPECT_NEAR(centre_m(sets[1], time_s).x(), x_m, 0.25) << time_s;
    EXPECT_NEAR(centre_m(sets[1], time_s).y(), 0.5, 1e-9);
  }
  EXPECT_LE(sets[0].likelihood + sets[1].likelihood, 1.0);
  // Along the wall nobody turns back.
  EXPECT_EQ(walks("{plugin: motion_patterns}", {1.5, 0.0}, {0.1, 1.0}, 6.0).size(), 1u);
}

TEST_F(BeforeAWall, GoalDirectedTurnsAlongTheWall) {
  const PredictedSet set =
      walk("{plugin: goal_directed, clearance_m: 0.1, reach_m: 0.5}", {0.0, 0.0}, {0.8, 0.6}, 8.0);
  // Within reach, the way left to the wall shrinks at a rate in proportion to it.
  const double reached_s = (2.0 - 0.3 - 0.1 - 0.5) / 0.8;
  for (const PredictedSet::Knot& knot : set.knots) {
    const double left_m = 0.5 * std::exp(-0.8 / 0.5 * std::max(0.0, knot.time_s - reached_s));
    const double x_m = knot.time_s < reached_s ? 0.8 * knot.time_s : 1.6 - left_m;
    EXPECT_NEAR(knot.centre_m.x(), x_m, 0.01) << knot.time_s;
    EXPECT_NEAR(knot.centre_m.y(), 0.6 * knot.time_s, 1e-9) << knot.time_s;
  }
}

TEST_F(BeforeAWall, GoalDirectedStopsWhereItGoesNoFurther) {
  const std::string block = "{plugin: goal_directed, clearance_m: 0.1, reach_m: 0.5}";
  for (const double speed_mps : {0.5, 1.5, 20.0}) {
    const PredictedSet set = walk(block, {-1.0, 0.5}, {speed_mps, 0.0}, 20.0);
    EXPECT_NEAR(set.knots.back().centre_m.x(), 1.6, 1e-3);
    EXPECT_NEAR(set.knots.back().centre_m.y(), 0.5, 1e-9);
    for (const PredictedSet::Knot& knot : set.knots) EXPECT_LT(knot.centre_m.x(), 1.6 + 1e-9);
  }
}

TEST_F(BeforeAWall, GoalDirectedGoesOnWhereNothingIsInItsWay) {
  for (const Eigen::Vector2d& velocity_mps :
       {Eigen::Vector2d(-1.0, 0.2), Eigen::Vector2d(0.0, 1.0)}) {
    const PredictedSet set = walk("{plugin: goal_directed}", {1.5, 0.0}, velocity_mps, 5.0);
    const Eigen::Vector2d end_m = Eigen::Vector2d(1.5, 0.0) + 5.0 * velocity_mps;
    EXPECT_LT((set.knots.back().centre_m - end_m).norm(), 1e-9);
  }
}

TEST_F(BeforeAWall, OrcaComesToRest) {
  const PredictedSet set = walk("{plugin: orca}", {-1.0, 0.5}, {1.0, 0.0}, 10.0);
  for (const PredictedSet::Knot& knot : set.knots) EXPECT_LT(knot.centre_m.x(), 1.7 + 1e-6);
  EXPECT_GT(set.knots.back().centre_m.x(), 1.0);
}

TEST(MotionPatterns, RepeatWhatATrackHasDone) {
  // To and fro between y = -2 and 2 at 0.8 m/s, in 10 s; another goes straight on for ever.
  const auto to_and_fro = [](double t) {
    const double way_m = std::fmod(0.8 * t, 8.0);
    return way_m < 4.0 ? std::pair(way_m - 2.0, 0.8) : std::pair(6.0 - way_m, -0.8);
  };
  const auto predictor = load_predictor("{plugin: motion_patterns}");
  Prediction last;
  for (int i = 0; i <= 360; ++i) {
    const double now_s = 0.05 * i;
    const auto [y_m, vy_mps] = to_and_fro(now_s);
    Tracks tracks{{track_at(1, {1.0, y_m}, {0.0, vy_mps}), track_at(2, {now_s, 5.0}, {1.0, 0.0})},
                  Stamp::from_seconds(now_s)};
    last = predictor->predict({tracks, 12.0}).value();
  }
  ASSERT_EQ(last.sets().size(), 2u);
  for (const double time_s : {0.0, 1.0, 4.0, 7.0, 12.0}) {
    // Places are remembered every 0.1 s, in which it goes 0.08 m.
    EXPECT_NEAR(centre_m(last.sets()[0], time_s).y(), to_and_fro(18.0 + time_s).first, 0.25);
    EXPECT_LT((centre_m(last.sets()[1], time_s) - Eigen::Vector2d(18.0 + time_s, 5.0)).norm(),
              1e-6);
  }
}

TEST(Orca, GoesStraightAlone) {
  const Tracks walker{{track_at(1, {0.0, 0.0}, {2.2, -0.4})}, kTracked};
  const Prediction prediction = predicted("{plugin: orca}", {walker, 5.0});
  for (const PredictedSet::Knot& knot : prediction.sets().at(0).knots) {
    EXPECT_LT((knot.centre_m - knot.time_s * Eigen::Vector2d(2.2, -0.4)).norm(), 1e-9);
  }
}

/// How near two paths come.
double nearest_m(const PredictedSet& set, const std::function<Eigen::Vector2d(double)>& other,
                 double until_s) {
  double nearest = 1e9;
  for (double time_s = 0.0; time_s <= until_s; time_s += 0.01) {
    nearest = std::min(nearest, (centre_m(set, time_s) - other(time_s)).norm());
  }
  return nearest;
}

TEST(Orca, KeepsWalkersApartWhoWouldMeet) {
  const Tracks two{{track_at(1, {-3.0, 0.0}, {1.0, 0.0}), track_at(2, {3.0, 0.1}, {-1.0, 0.0})},
                   kTracked};
  const auto between_m = [&](const std::string& block) {
    const Prediction prediction = predicted(block, {two, 6.0});
    const PredictedSet& second = prediction.sets().at(1);
    return nearest_m(
        prediction.sets().at(0), [&](double t) { return centre_m(second, t); }, 6.0);
  };
  EXPECT_NEAR(between_m("{plugin: constant_velocity}"), 0.1, 1e-6);
  EXPECT_GT(between_m("{plugin: orca, step_s: 0.1}"), 0.6 - 1e-3);  // their radii
}

TEST(Orca, MakesWayForTheRobotOnlyWhereItSeesIt) {
  const Tracks walker{{track_at(1, {-3.0, 0.05}, {1.0, 0.0})}, kTracked};
  const RobotFootprint robot{{3.0, 0.0}, {-0.5, 0.0}, 0.4};
  PredictionRequest request{walker, 6.0};
  request.robot = &robot;
  const auto from_robot_m = [&](const std::string& block) {
    const Prediction prediction = predicted(block, request);
    const auto at = [&](double t) {
      return Eigen::Vector2d(robot.position_m + t * robot.velocity_mps);
    };
    return nearest_m(prediction.sets().at(0), at, 6.0);
  };
  EXPECT_NEAR(from_robot_m("{plugin: orca}"), 0.05, 1e-6);
  // Its half of the avoidance, of which the robot does nothing.
  EXPECT_GT(from_robot_m("{plugin: orca, sees_robot: true, step_s: 0.1}"), 0.5);
}

TEST(None, SaysNothing) {
  EXPECT_TRUE(predicted("{plugin: none}", {walking_people(3, 1), 5.0}).sets().empty());
}

TEST(Truth, IsKnownInSimulationOnly) {
  HostFixture fixture({PLUGIN_FOLDER});
  const auto made = fixture.host.create<Predictor>(HostFixture::block("{plugin: truth}"));
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(made.error().describe().find("predictor truth"), std::string::npos);
  EXPECT_NE(made.error().describe().find("simulation"), std::string::npos);
}

SceneObject moving(const std::string& name, Shape shape, std::vector<Waypoint> waypoints) {
  SceneObject object;
  object.name = name;
  object.shape = std::move(shape);
  object.waypoints = std::move(waypoints);
  return object;
}

Waypoint at(double time_s, const Eigen::Vector3d& p_m,
            const Eigen::Vector3d& turn_rad = {0, 0, 0}) {
  Transform pose = Transform::Identity();
  pose.translation() = p_m;
  if (turn_rad.norm() > 0.0) {
    pose.linear() = Eigen::AngleAxisd(turn_rad.norm(), turn_rad.normalized()).toRotationMatrix();
  }
  return {time_s, pose};
}

/// What walks, rolls and falls over between times 5 and 14.
std::shared_ptr<const Scene> busy_scene() {
  const Mesh wedge = {{{0.4, 0.0, 0.0}, {-0.2, 0.3, 0.1}, {-0.2, -0.3, 0.0}, {0.0, 0.0, 0.9}},
                      {{0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 2, 1}},
                      nullptr};
  return std::make_shared<const Scene>(std::vector<SceneObject>{
      moving("walker", Cylinder{0.25, 1.7},
             {at(5.0, {-2, 0, 0.9}), at(8.03, {1, 1, 0.9}), at(14.0, {2, -3, 0.9})}),
      moving("felled", Cylinder{0.2, 1.0},
             {at(6.0, {3, 3, 0.5}), at(9.0, {3, 3, 0.5}, {1.3, 0, 0})}),
      moving("crate", Box{{0.5, 0.9, 0.4}},
             {at(5.0, {-3, -2, 0.5}), at(12.0, {0, -2, 0.2}, {0.4, 0, 2.0})}),
      moving("ball", Sphere{0.15}, {at(5.0, {0, 3, 0.15}), at(13.0, {-3, -3, 1.0})}),
      moving("tube", Capsule{0.1, 0.8}, {at(5.0, {2, 2, 1}, {0, 1, 0}), at(13.0, {1, 2, 1})}),
      moving("wedge", indexed_mesh(wedge), {at(5.0, {4, 0, 0}), at(13.0, {4, 2, 0}, {0, 0.5, 0})}),
      moving("pillar", Box{{1, 1, 3}}, {at(0.0, {0, 0, 1.5})})});
}

TEST(Truth, HoldsWhateverMovesAndLittleElse) {
  const auto scene = busy_scene();
  const auto predictor = load_predictor("{plugin: truth}", scene);
  const Tracks nobody{{}, Stamp::from_seconds(6.5)};
  const auto prediction = predictor->predict({nobody, 6.0});
  ASSERT_TRUE(prediction) << prediction.error().describe();
  EXPECT_EQ(prediction->stamp(), nobody.stamp);
  ASSERT_EQ(prediction->sets().size(), 6u);  // without the pillar
  std::mt19937 random(4);
  std::uniform_real_distribution<double> time(0.0, 6.0), reach(-0.95, 0.95);
  for (std::size_t i = 0; i < 6; ++i) {
    const SceneObject& object = scene->objects()[i];
    const PredictedSet& set = prediction->sets()[i];
    EXPECT_LT(set.track, 0) << object.name;
    EXPECT_EQ(set.knots.front().time_s, 0.0);
    EXPECT_EQ(set.knots.back().time_s, 6.0);
    int inside = 0;
    double lowest_m = 1e9, highest_m = -1e9, widest_m = 0.0;
    for (int k = 0; k < 100000; ++k) {
      const double time_s = time(random);
      const Transform pose = object.T_world_object(6.5 + time_s);
      const Eigen::Vector3d p = pose * Eigen::Vector3d(reach(random), reach(random), reach(random));
      if (signed_distance_m(object.shape, pose.inverse() * p) > 0.0) continue;
      ++inside;
      lowest_m = std::min(lowest_m, p.z());
      highest_m = std::max(highest_m, p.z());
      widest_m = std::max(widest_m, (p - pose.translation()).head<2>().norm());
      double distance = 0.0;
      prediction->query(time_s, {&p, 1}, {&distance, 1}, {});
      // Between knots 0.1 s apart, what turns is not quite where a line has it.
      EXPECT_LT(distance, 2e-3) << object.name << " at " << time_s;
    }
    EXPECT_GT(inside, 100) << object.name;
    double radius_m = 0.0;
    for (const PredictedSet::Knot& knot : set.knots) radius_m = std::max(radius_m, knot.radius_m);
    EXPECT_LT(radius_m, widest_m + 0.2) << object.name;
    EXPECT_LT(highest_m, set.top_m + 1e-3);
    EXPECT_LT(set.top_m, highest_m + 0.15) << object.name;
    EXPECT_LT(lowest_m - 0.15, set.bottom_m) << object.name;
  }
}

TEST(Truth, IsExactOfAnUprightCylinderAtEveryTime) {
  const auto scene = busy_scene();
  const auto predictor = load_predictor("{plugin: truth}", scene);
  const Tracks nobody{{}, Stamp::from_seconds(6.5)};
  const Prediction prediction = predictor->predict({nobody, 6.0}).value();
  const Prediction walker = Prediction::create(nobody.stamp, {prediction.sets()[0]}).value();
  const SceneObject& object = scene->objects()[0];
  std::mt19937 random(5);
  std::uniform_real_distribution<double> time(0.0, 6.0), place(-4.0, 4.0);
  for (int k = 0; k < 2000; ++k) {
    const double time_s = time(random);
    const Eigen::Vector3d p(place(random), place(random), 0.9);
    const Eigen::Vector2d axis = object.T_world_object(6.5 + time_s).translation().head<2>();
    const double outside_m = (p.head<2>() - axis).norm() - 0.25;
    if (outside_m < 0.0) continue;  // the end may be nearer than the side
    double distance = 0.0;
    walker.query(time_s, {&p, 1}, {&distance, 1}, {});
    EXPECT_NEAR(distance, outside_m, 1e-9);
  }
}

/// Recorded pedestrians (the data's README.md), 2.5 samples a second.
class RecordedPeople : public testing::Test {
 protected:
  static constexpr double kStep_s = 0.4;

  void SetUp() override {
    const auto file = std::filesystem::path(SIDESTEP_SHARED_DATA) / "crowds" / "eth.csv";
    std::ifstream in(file);
    if (!in) GTEST_SKIP() << "no data at " << file;
    std::string line;
    while (std::getline(in, line)) {
      int person = 0;
      double time_s = 0.0, x_m = 0.0, y_m = 0.0;
      if (std::sscanf(line.c_str(), "%d,%lf,%lf,%lf", &person, &time_s, &x_m, &y_m) != 4) continue;
      samples_[std::lround(time_s / kStep_s)][person] = {x_m, y_m};
    }
    ASSERT_GT(samples_.size(), 500u);
  }

  /// Calls visit(prediction, tracks, sample) at every fourth sample, tracks being all who were
  /// there at the one before, too.
  template <class Visit>
  void each(const std::string& block, double horizon_s, Visit visit) {
    const auto predictor = load_predictor(block);
    for (const auto& [sample, people] : samples_) {
      const auto before = samples_.find(sample - 1);
      if (sample % 4 != 0 || before == samples_.end()) continue;
      Tracks tracks{{}, kTracked};
      for (const auto& [person, at_m] : people) {
        const auto then = before->second.find(person);
        if (then == before->second.end()) continue;
        tracks.tracks.push_back(track_at(person, at_m, (at_m - then->second) / kStep_s));
      }
      const auto prediction = predictor->predict({tracks, horizon_s});
      ASSERT_TRUE(prediction) << prediction.error().describe();
      visit(*prediction, sample);
    }
  }

  /// Where everybody was that many samples later, and how far off the sets' centres are.
  [[nodiscard]] double median_error_m(const std::string& block, long ahead) {
    std::vector<double> errors_m;
    each(block, static_cast<double>(ahead) * kStep_s, [&](const Prediction& prediction, long now) {
      const auto people = samples_.find(now + ahead);
      if (people == samples_.end()) return;
      for (const PredictedSet& set : prediction.sets()) {
        const auto later = people->second.find(static_cast<int>(set.track));
        if (later == people->second.end()) continue;
        errors_m.push_back((set.knots.back().centre_m - later->second).norm());
      }
    });
    EXPECT_GT(errors_m.size(), 500u);
    std::ranges::sort(errors_m);
    return errors_m.empty() ? 1e9 : errors_m[errors_m.size() / 2];
  }

  std::map<long, std::map<int, Eigen::Vector2d>> samples_;
};

TEST_F(RecordedPeople, AreWhereTheWorstCaseAllows) {
  int seen = 0, missed = 0;
  each("{plugin: worst_case, speed_mps: 2.5}", 4.0, [&](const Prediction& prediction, long now) {
    for (const PredictedSet& set : prediction.sets()) {
      for (long ahead = 0; ahead <= 10; ++ahead) {
        const auto later = samples_.find(now + ahead);
        if (later == samples_.end()) continue;
        const auto at = later->second.find(static_cast<int>(set.track));
        if (at == later->second.end()) continue;
        ++seen;
        missed += distance_m(prediction, static_cast<double>(ahead) * kStep_s, at->second) > 0.0;
      }
    }
  });
  EXPECT_GT(seen, 5000);
  EXPECT_LT(missed, seen / 500);
}

TEST_F(RecordedPeople, AreNearerToTheirPredictionThanToWhereTheyWere) {
  const double standing_m = median_error_m("{plugin: worst_case}", 5);
  for (const char* name : {"constant_velocity", "goal_directed", "orca"}) {
    EXPECT_LT(median_error_m(format("{plugin: %s}", name), 5), 0.25 * standing_m) << name;
  }
}

}  // namespace
}  // namespace sidestep
