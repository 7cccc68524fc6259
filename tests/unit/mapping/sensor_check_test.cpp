#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>

#include <sidestep/mapping/sensor_check.hpp>

namespace sidestep {
namespace {

using ::testing::HasSubstr;

constexpr double kDegree = 0.017453292519943295;

/// A camera at 1.1 m, 30 degrees down, and what it measures, by the formulas of ray and plane.
class SensorFaults : public ::testing::Test {
 protected:
  static Transform camera_pose(double yaw_rad = 0.0) {
    Transform T = transform_from_xyz_rpy({0.3, -0.2, 1.1}, {0.0, 0.52, yaw_rad});
    return T * T_forward_optical();
  }
  /// A horizontal plane at `height_m` beyond x = `from_m`, the floor, and a wall at x = 4.
  Frame frame(double time_s, const Transform& T_world_camera, double height_m = 0.0,
              double from_m = 100.0) {
    DepthImage image{{160, 120, 138.6, 138.6, 79.5, 59.5}, {}};
    const Eigen::Vector3d eye = T_world_camera.translation();
    for (int v = 0; v < 120; ++v) {
      for (int u = 0; u < 160; ++u) {
        const Eigen::Vector3d ray = T_world_camera.linear() * image.camera.unproject(u, v, 1.0);
        double depth_m = ray.x() > 0.0 ? (4.0 - eye.x()) / ray.x() : 1e9;
        const auto meet = [&](double z_m, double least_x) {
          const double at = (z_m - eye.z()) / ray.z();
          if (at > 0.0 && eye.x() + at * ray.x() >= least_x) depth_m = std::min(depth_m, at);
        };
        meet(0.0, -100.0);
        meet(height_m, from_m);
        if (depth_m > 5.0) depth_m = 0.0;
        const double sigma_m = noise_ * (0.0012 + 0.0019 * (depth_m - 0.4) * (depth_m - 0.4));
        if (depth_m > 0.0) depth_m += sigma_m * normal_(random_);
        image.depth_m.push_back(static_cast<float>(depth_m));
      }
    }
    Frame made;
    made.stamp = Stamp::from_seconds(time_s);
    made.T_world_camera = T_world_camera;
    made.measurement = std::move(image);
    return made;
  }
  static Frame turned(Frame frame, const Eigen::Vector3d& by_rad) {
    frame.T_world_camera =
        frame.T_world_camera * transform_from_xyz_rpy(Eigen::Vector3d::Zero(), by_rad);
    return frame;
  }
  /// When, after the first frame at 10 Hz, something was wrong first, and what.
  template <class Make>
  std::pair<double, std::string> noticed(SensorCheck& check, const Make& make, int frames = 20) {
    for (int i = 0; i < frames; ++i) {
      const auto checked = check.check(make(0.1 * i));
      if (!checked) return {0.1 * i, checked.error().message};
    }
    return {1e9, ""};
  }

  double noise_ = 1.0;
  std::mt19937 random_{5};
  std::normal_distribution<double> normal_;
  SensorCheck check_{0.0};
};

TEST_F(SensorFaults, AreNoneOfACameraThatIsSound) {
  for (const double noise : {0.0, 1.0, 2.0}) {
    noise_ = noise;
    SensorCheck check(0.0);
    const auto sound = [&](double t) { return frame(t, camera_pose(0.3 * std::sin(t))); };
    EXPECT_EQ(noticed(check, sound, 60).second, "");
  }
}

TEST_F(SensorFaults, AreNoneOfAStepOrTableBeforeIt) {
  for (const double height_m : {0.03, 0.06, 0.1, 0.2, 0.45}) {
    for (const double from_m : {0.8, 1.2, 1.6, 2.2}) {
      SensorCheck check(0.0);
      const auto step = [&](double t) { return frame(t, camera_pose(), height_m, from_m); };
      EXPECT_EQ(noticed(check, step).second, "") << height_m << ", " << from_m;
    }
  }
}

TEST_F(SensorFaults, AreMountsThatAreOffByFiveDegrees) {
  for (const Eigen::Vector3d& by : {Eigen::Vector3d(5, 0, 0), Eigen::Vector3d(-5, 0, 0),
                                    Eigen::Vector3d(0, 0, 5), Eigen::Vector3d(0, 0, -5)}) {
    SensorCheck check(0.0);
    const auto off = [&](double t) { return turned(frame(t, camera_pose()), kDegree * by); };
    const auto [time_s, what] = noticed(check, off);
    EXPECT_LT(time_s, 0.5) << by.transpose();
    EXPECT_THAT(what, HasSubstr("the floor tilted by"));
  }
}

TEST_F(SensorFaults, AreLensesThatLieByATenth) {
  for (const double scale : {0.9, 1.1}) {
    SensorCheck check(0.0);
    const auto lies = [&](double t) {
      Frame made = frame(t, camera_pose());
      auto& camera = std::get<DepthImage>(made.measurement).camera;
      camera.fx_px *= scale;
      camera.fy_px *= scale;
      return made;
    };
    const auto [time_s, what] = noticed(check, lies);
    EXPECT_LT(time_s, 0.5) << scale;
    EXPECT_THAT(what, HasSubstr("its lens"));
  }
}

/// A mount is off for good: nobody moves by it for the frames that do not tell, either.
TEST_F(SensorFaults, LastUntilFramesOfASecondShowTheOpposite) {
  const auto off = [&](double t) { return turned(frame(t, camera_pose()), {5 * kDegree, 0, 0}); };
  ASSERT_LT(noticed(check_, off).first, 0.5);
  Frame nothing = frame(0.0, camera_pose());
  std::ranges::fill(std::get<DepthImage>(nothing.measurement).depth_m, 0.0F);
  nothing.T_world_camera = camera_pose() * transform_from_xyz_rpy({0, 0, 0}, {1.5, 0, 0});
  for (double t = 2.0; t < 4.0; t += 0.1) {
    nothing.stamp = Stamp::from_seconds(t);
    EXPECT_FALSE(check_.check(nothing));
  }
  double first_s = 1e9;
  for (double t = 4.0; t < 8.0 && first_s > 1e8; t += 0.1) {
    if (check_.check(frame(t, camera_pose()))) first_s = t - 4.0;
  }
  EXPECT_GE(first_s, 0.99);
  EXPECT_LE(first_s, 1.2);
}

TEST_F(SensorFaults, AreFrozenImagesOfACameraWithNoise) {
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(check_.check(frame(-1.0 + 0.1 * i, camera_pose())));
  const Frame last = frame(0.0, camera_pose());
  const auto frozen = [&](double t) {
    Frame made = last;
    made.stamp = Stamp::from_seconds(t);
    return made;
  };
  const auto [time_s, what] = noticed(check_, frozen);
  EXPECT_LT(time_s, 0.5);
  EXPECT_THAT(what, HasSubstr("frozen"));
}

TEST_F(SensorFaults, AreFrozenImagesOfACameraThatTurns) {
  noise_ = 0.0;
  const Frame last = frame(0.0, camera_pose());
  const auto frozen = [&](double t) {
    Frame made = last;
    made.stamp = Stamp::from_seconds(t);
    made.T_world_camera = camera_pose(0.2 * t);
    return made;
  };
  const auto [time_s, what] = noticed(check_, frozen);
  EXPECT_LT(time_s, 1.0);
  EXPECT_THAT(what, HasSubstr("frozen"));
}

TEST_F(SensorFaults, AreNotImagesWithoutNoiseOfARobotAtRest) {
  noise_ = 0.0;
  EXPECT_EQ(noticed(
                check_, [&](double t) { return frame(t, camera_pose()); }, 100)
                .second,
            "");
}

TEST_F(SensorFaults, AreImagesWithoutAReturn) {
  const auto blind = [&](double t) {
    Frame made = frame(t, camera_pose());
    std::ranges::fill(std::get<DepthImage>(made.measurement).depth_m, 0.0F);
    return made;
  };
  const auto [time_s, what] = noticed(check_, blind);
  EXPECT_LT(time_s, 0.5);
  EXPECT_THAT(what, HasSubstr("blind"));
  // Towards the sky there is nothing to be seen.
  SensorCheck check(0.0);
  const auto up = [&](double t) {
    Frame made = blind(t);
    made.T_world_camera = camera_pose() * transform_from_xyz_rpy({0, 0, 0}, {1.5, 0, 0});
    return made;
  };
  EXPECT_EQ(noticed(check, up).second, "");
}

/// Looking level, no ray meets the floor: but it has just seen the wall.
TEST_F(SensorFaults, AreImagesWithoutAReturnFromWhereSomethingWas) {
  const Transform level =
      transform_from_xyz_rpy({0.3, -0.2, 1.1}, {0.0, 0.0, 0.0}) * T_forward_optical();
  ASSERT_TRUE(check_.check(frame(-0.1, level)));
  const auto blind = [&](double t) {
    Frame made = frame(t, level);
    std::ranges::fill(std::get<DepthImage>(made.measurement).depth_m, 0.0F);
    return made;
  };
  const auto [time_s, what] = noticed(check_, blind);
  EXPECT_LT(time_s, 0.5);
  EXPECT_THAT(what, HasSubstr("blind"));
}

TEST_F(SensorFaults, AreNoneOfAFirstFrameWhoseCameraIsAtTheOrigin) {
  EXPECT_TRUE(check_.check(frame(0.0, Transform::Identity())));
}

TEST_F(SensorFaults, OfFramesThatAreUnusableAreNotItsTask) {
  Frame broken = frame(0.0, camera_pose());
  std::get<DepthImage>(broken.measurement).depth_m.resize(10);
  EXPECT_TRUE(check_.check(broken));
}

/// A laser 0.2 m above the floor in a corridor along x, 1.2 m wide, with a pole in it.
class LaserFaults : public ::testing::Test {
 protected:
  Frame scan(double time_s, double x_m, double yaw_rad, double y_m = 0.0) {
    Frame made;
    made.stamp = Stamp::from_seconds(time_s);
    made.T_world_camera = transform_from_xyz_rpy({x_m, y_m, 0.2}, {0.0, 0.0, yaw_rad});
    PointCloud points;
    for (int i = 0; i < 721; ++i) {
      const double angle = -2.35619 + 4.71239 * i / 720.0;
      const Eigen::Vector2d ray(std::cos(angle + yaw_rad), std::sin(angle + yaw_rad));
      double range_m = 8.0;
      for (const double wall : {-0.35, 0.85}) {
        if ((wall - y_m) / ray.y() > 0.0) range_m = std::min(range_m, (wall - y_m) / ray.y());
      }
      const Eigen::Vector2d to_pole = pole_m_ - Eigen::Vector2d(x_m, y_m);
      const double along = to_pole.dot(ray), beside2 = to_pole.squaredNorm() - along * along;
      if (along > 0.0 && beside2 < 0.0016) {
        range_m = std::min(range_m, along - std::sqrt(0.0016 - beside2));
      }
      const bool is_hanging = has_cable_ && i >= 240 && i < 252;
      if (is_hanging) range_m = 0.15;
      const double measured_m = range_m + 0.01 * normal_(random_);
      points.points_m.emplace_back(
          (measured_m * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0)).cast<float>());
    }
    made.measurement = std::move(points);
    return made;
  }
  /// What was wrong first while the robot drove and turned, and when.
  std::pair<double, std::string> noticed(double speed_mps, double turn_radps) {
    SensorCheck check(0.0);
    for (int i = 0; i < 100; ++i) {
      const double t = 0.1 * i;
      if (auto checked = check.check(scan(t, speed_mps * t, turn_radps * t)); !checked) {
        return {t, checked.error().message};
      }
    }
    return {1e9, ""};
  }

  bool has_cable_ = false;
  Eigen::Vector2d pole_m_{0.6, 0.25};
  std::mt19937 random_{5};
  std::normal_distribution<double> normal_;
};

TEST_F(LaserFaults, AreNoneInACorridorWithAPole) {
  for (const double speed_mps : {0.0, 0.12, 0.5}) {
    for (const double turn_radps : {0.0, 0.3, -1.0}) {
      EXPECT_EQ(noticed(speed_mps, turn_radps).second, "") << speed_mps << ", " << turn_radps;
    }
  }
}

TEST_F(LaserFaults, AreNoneOfAPoleThatItGoesAround) {
  for (const double radius_m : {0.25, 0.4, 0.48}) {
    SensorCheck check(0.0);
    for (int i = 0; i < 60; ++i) {
      const double bearing_rad = 2.2 + 0.4 * 0.1 * i;
      const Eigen::Vector2d at_m =
          pole_m_ + radius_m * Eigen::Vector2d(std::cos(bearing_rad), std::sin(bearing_rad));
      EXPECT_TRUE(check.check(scan(0.1 * i, at_m.x(), bearing_rad + std::numbers::pi, at_m.y())))
          << radius_m << ", frame " << i;
    }
  }
}

TEST_F(LaserFaults, AreThingsThatHangBeforeIt) {
  has_cable_ = true;
  for (const auto& [speed_mps, turn_radps] :
       {std::pair(0.12, 0.0), std::pair(0.4, 0.0), std::pair(0.0, 0.3), std::pair(0.0, -1.0)}) {
    const auto [time_s, what] = noticed(speed_mps, turn_radps);
    EXPECT_LT(time_s, 1.3) << speed_mps << ", " << turn_radps;
    EXPECT_THAT(what, HasSubstr("sees its own robot: something 0.1"));
  }
  // Who stands still learns nothing of it.
  EXPECT_EQ(noticed(0.0, 0.0).second, "");
}

TEST_F(LaserFaults, AreFrozenScans) {
  SensorCheck check(0.0);
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(check.check(scan(0.1 * i, 0.0, 0.0)));
  Frame last = scan(1.0, 0.0, 0.0);
  double noticed_s = 1e9;
  std::string what;
  for (double t = 1.0; t < 3.0 && noticed_s > 1e8; t += 0.1) {
    last.stamp = Stamp::from_seconds(t);
    if (auto checked = check.check(last); !checked) {
      noticed_s = t;
      what = checked.error().message;
    }
  }
  EXPECT_LT(noticed_s, 1.5);
  EXPECT_THAT(what, HasSubstr("the laser is frozen"));
}

/// Clouds of other sensors may look the same, and lose all of their points.
TEST_F(LaserFaults, AreNoneOfOtherClouds) {
  SensorCheck check(0.0);
  Frame cloud = scan(0.0, 0.0, 0.0);
  for (Eigen::Vector3f& p : std::get<PointCloud>(cloud.measurement).points_m) p.z() = 0.3F * p.x();
  for (int i = 0; i < 30; ++i) {
    cloud.stamp = Stamp::from_seconds(0.1 * i);
    if (i == 20) std::get<PointCloud>(cloud.measurement).points_m.clear();
    EXPECT_TRUE(check.check(cloud)) << i;
  }
}

}  // namespace
}  // namespace sidestep
