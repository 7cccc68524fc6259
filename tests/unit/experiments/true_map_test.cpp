#include <sidestep/measures/true_map.hpp>

#include <gtest/gtest.h>

namespace sidestep {
namespace {

SceneObject upright(const std::string& name, double x_m, double speed_mps) {
  SceneObject object;
  object.name = name;
  object.shape = Cylinder{0.3, 1.8};
  Transform pose = Transform::Identity();
  pose.translation() = Eigen::Vector3d(x_m, 0.0, 0.9);
  object.waypoints = {{0.0, pose}};
  if (speed_mps == 0.0) return object;
  pose.translation().y() = 10.0 * speed_mps;
  object.waypoints.push_back({10.0, pose});
  return object;
}

double distance_m(const TrueMap& map, const Eigen::Vector3d& p) {
  double distance = 0.0;
  Eigen::Vector3d gradient;
  FieldStatus status = FieldStatus::kKnown;
  map.field->query({&p, 1}, {&distance, 1}, {&gradient, 1}, {&status, 1});
  return distance;
}

TEST(TrueMap, HasWhatMovesAsTracksAndWhereItIsNotMaskedInTheField) {
  const Scene scene({upright("post", 0.0, 0.0), upright("walker", 4.0, 0.5)});
  const Eigen::AlignedBox3d bounds_m(Eigen::Vector3d::Constant(-50.0),
                                     Eigen::Vector3d::Constant(50.0));
  const Stamp time = Stamp::from_seconds(4.0);  // it is at (4, 2)
  const Eigen::Vector3d beside_m(4.0, 3.0, 1.0);
  const TrueMap masked = true_map(scene, time, bounds_m);
  ASSERT_EQ(masked.tracks->tracks.size(), 1u);
  const Track& walker = masked.tracks->tracks[0];
  EXPECT_LT((walker.position_m - Eigen::Vector2d(4.0, 2.0)).norm(), 1e-9);
  EXPECT_LT((walker.velocity_mps - Eigen::Vector2d(0.0, 0.5)).norm(), 1e-6);
  EXPECT_NEAR(walker.radius_m, 0.3, 1e-9);
  EXPECT_NEAR(distance_m(masked, beside_m), 5.0 - 0.3, 1e-6);  // of the post
  const TrueMap whole = true_map(scene, time, bounds_m, false);
  EXPECT_EQ(whole.tracks->tracks.size(), 1u);
  EXPECT_NEAR(distance_m(whole, beside_m), 1.0 - 0.3, 1e-6);
}

TEST(TrueMap, TakesWhatHasStoodForASecondForAnObstacle) {
  const Scene scene({upright("walker", 4.0, 0.5)});  // for 10 s, then it stands at (4, 5)
  const Eigen::AlignedBox3d bounds_m(Eigen::Vector3d::Constant(-50.0),
                                     Eigen::Vector3d::Constant(50.0));
  const Eigen::Vector3d beside_m(4.0, 6.0, 1.0);
  const TrueMap before = true_map(scene, Stamp::from_seconds(10.9), bounds_m);
  EXPECT_EQ(before.tracks->tracks.size(), 1u);
  EXPECT_GT(distance_m(before, beside_m), 10.0);
  const TrueMap after = true_map(scene, Stamp::from_seconds(11.1), bounds_m);
  EXPECT_TRUE(after.tracks->tracks.empty());
  EXPECT_NEAR(distance_m(after, beside_m), 0.7, 1e-6);
}

}  // namespace
}  // namespace sidestep
