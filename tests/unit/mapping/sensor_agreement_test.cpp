#include <cmath>
#include <random>
#include <vector>

#include <gmock/gmock.h>

#include <sidestep/geometry/ray_caster.hpp>
#include <sidestep/mapping/sensor_agreement.hpp>

namespace sidestep {
namespace {

using ::testing::HasSubstr;

constexpr double kOneDegree = 0.017453292519943295;

/// A room of 5 x 4 m with a crate, a camera 1.1 m and a laser 0.18 m above its floor.
class TwoViews : public ::testing::Test {
 protected:
  static SceneObject box(const char* name, const Eigen::Vector3d& size_m,
                         const Eigen::Vector3d& at_m) {
    Waypoint waypoint;
    waypoint.T_world_object.translation() = at_m;
    return {name, Box{size_m}, {waypoint}};
  }
  static Scene room() {
    return Scene({box("floor", {9, 9, 0.2}, {0, 0, -0.1}), box("ahead", {0.2, 9, 3}, {2.6, 0, 1.5}),
                  box("left", {9, 0.2, 3}, {0, 2.1, 1.5}),
                  box("right", {9, 0.2, 3}, {0, -2.1, 1.5}),
                  box("crate", {0.4, 0.6, 0.5}, {1.7, 0.8, 0.25})});
  }
  Frame scan(double time_s, double yaw_rad) {
    Frame made;
    made.stamp = Stamp::from_seconds(time_s);
    made.T_world_camera = transform_from_xyz_rpy(
        {0.17 * std::cos(yaw_rad), 0.17 * std::sin(yaw_rad), 0.18}, {0.0, 0.0, yaw_rad});
    std::vector<Eigen::Vector3d> rays;
    for (int i = 0; i < 721; ++i) {
      const double angle = -2.35619 + 4.71239 * i / 720.0;
      rays.emplace_back(std::cos(angle), std::sin(angle), 0.0);
    }
    PointCloud points;
    for (const auto& [ray, length_m] : cast(made.T_world_camera, rays)) {
      points.points_m.emplace_back(((length_m + 0.01 * normal_(random_)) * ray).cast<float>());
    }
    made.measurement = std::move(points);
    return made;
  }
  /// It looks down by 30 degrees and to a side, and is said to be turned by `off_rad` more.
  Frame image(double time_s, double yaw_rad, double pan_rad, double off_rad) {
    Frame made;
    made.stamp = Stamp::from_seconds(time_s);
    const auto pose = [&](double more_rad) {
      return Transform(
          transform_from_xyz_rpy({0.0, 0.0, 1.1}, {0.0, 0.52, yaw_rad + pan_rad + more_rad}) *
          T_forward_optical());
    };
    DepthImage image{{160, 120, 138.6, 138.6, 79.5, 59.5}, {}};
    std::vector<Eigen::Vector3d> rays;
    for (int v = 0; v < 120; ++v) {
      for (int u = 0; u < 160; ++u) rays.push_back(image.camera.unproject(u, v, 1.0).normalized());
    }
    for (const auto& [ray, length_m] : cast(pose(0.0), rays)) {
      const double depth_m = length_m * ray.z();
      const double sigma_m = 0.0012 + 0.0019 * (depth_m - 0.4) * (depth_m - 0.4);
      image.depth_m.push_back(static_cast<float>(depth_m + sigma_m * normal_(random_)));
    }
    made.T_world_camera = pose(off_rad);
    made.measurement = std::move(image);
    return made;
  }
  std::vector<std::pair<Eigen::Vector3d, double>> cast(const Transform& T_world_sensor,
                                                       const std::vector<Eigen::Vector3d>& rays) {
    std::vector<Eigen::Vector3d> directions;
    for (const Eigen::Vector3d& ray : rays) directions.push_back(T_world_sensor.linear() * ray);
    std::vector<double> lengths_m(rays.size());
    caster_.cast_distances(T_world_sensor.translation(), directions, lengths_m);
    std::vector<std::pair<Eigen::Vector3d, double>> both;
    for (std::size_t i = 0; i < rays.size(); ++i) both.emplace_back(rays[i], lengths_m[i]);
    return both;
  }
  /// When they did not agree first, at 10 Hz each, and what was said.
  std::pair<double, std::string> noticed(double turn_radps, double pan_rad, double off_rad) {
    SensorAgreement agreement;
    for (int i = 0; i < 30; ++i) {
      const double t = 0.1 * i;
      EXPECT_TRUE(agreement.check(scan(t - 0.02, turn_radps * (t - 0.02))));
      if (auto checked = agreement.check(image(t, turn_radps * t, pan_rad, off_rad)); !checked) {
        return {t, checked.error().message};
      }
    }
    return {1e9, ""};
  }

  RayCaster caster_{room()};
  std::mt19937 random_{5};
  std::normal_distribution<double> normal_;
};

TEST_F(TwoViews, AgreeWhereSensorsAreMountedAsTheyAreSaidToBe) {
  for (const double pan_rad : {-0.9, -0.4, 0.0, 0.3, 0.7, 1.1}) {
    for (const double turn_radps : {0.0, 0.3}) {
      for (const double off : {-0.8, 0.0, 0.8}) {
        EXPECT_EQ(noticed(turn_radps, pan_rad, off * kOneDegree).second, "")
            << pan_rad << ", " << turn_radps << ", " << off;
      }
    }
  }
}

/// A wall straight ahead is as far away as it would be: from where the view is mostly that, nobody
/// can tell.
TEST_F(TwoViews, DoNotAgreeWhereAMountIsOffByFiveDegrees) {
  for (const double pan_rad : {-0.9, -0.7, 0.7, 0.9}) {
    for (const double off : {-5.0, 5.0}) {
      const auto [time_s, what] = noticed(0.0, pan_rad, off * kOneDegree);
      EXPECT_LT(time_s, 1.0) << pan_rad << ", " << off;
      EXPECT_THAT(what, HasSubstr("camera and laser do not agree")) << pan_rad << ", " << off;
    }
  }
}

/// Scans are sound as far as anybody can tell: they go on to be noted.
TEST_F(TwoViews, AgreeAgainOnceTheMountIsRight) {
  SensorAgreement agreement;
  std::vector<bool> agreed;
  for (int i = 0; i < 40; ++i) {
    const Frame laser = scan(0.1 * i, 0.0);
    EXPECT_TRUE(agreement.check(laser));
    const double off_rad = i < 10 ? 5.0 * kOneDegree : 0.0;
    agreed.push_back(static_cast<bool>(agreement.check(image(0.1 * i, 0.0, 0.8, off_rad))));
  }
  EXPECT_FALSE(agreed[9]);
  EXPECT_FALSE(agreed[18]);  // a second has not passed
  EXPECT_TRUE(agreed[21]);
}

/// Somebody who walks past is elsewhere in the next scan.
TEST_F(TwoViews, AgreeOnWhoWalksPast) {
  SensorAgreement agreement;
  for (int i = 0; i < 15; ++i) {
    const double t = 0.1 * i;
    const auto somebody = [&](double at_s) {
      Scene scene({box("floor", {9, 9, 0.2}, {0, 0, -0.1}),
                   box("somebody", {0.5, 0.5, 1.7}, {1.2, -0.6 + 1.2 * at_s, 0.85})});
      caster_ = RayCaster(scene);
    };
    somebody(t);
    EXPECT_TRUE(agreement.check(image(t, 0.0, 0.0, 0.0))) << t;
    somebody(t + 0.02);
    EXPECT_TRUE(agreement.check(scan(t + 0.02, 0.0)));
  }
}

/// The scan is too old, or the camera sees nothing at its height.
TEST_F(TwoViews, SayNothingWhereTheyDoNotSeeTheSame) {
  SensorAgreement late, up;
  for (int i = 0; i < 30; ++i) {
    EXPECT_TRUE(late.check(scan(0.1 * i, 0.0)));
    EXPECT_TRUE(late.check(image(0.1 * i + 0.05, 0.0, 0.3, 5 * kOneDegree)));
    EXPECT_TRUE(up.check(scan(0.1 * i, 0.0)));
    Frame looks_up = image(0.1 * i, 0.0, 0.3, 5 * kOneDegree);
    for (float& depth_m : std::get<DepthImage>(looks_up.measurement).depth_m) depth_m = 0.0F;
    EXPECT_TRUE(up.check(looks_up));
  }
}

}  // namespace
}  // namespace sidestep
