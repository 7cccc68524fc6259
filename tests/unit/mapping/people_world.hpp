#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/time.hpp>
#include <sidestep/geometry/ray_caster.hpp>
#include <sidestep/mapping/tracker.hpp>

#include "conformance/test_host.hpp"
#include "depth_sensor.hpp"
#include "voxel_grid.hpp"

namespace sidestep::testing_support {

/// A person of 0.5 m across and 1.7 m high, who walks through places at times.
struct Walk {
  struct Place {
    double time_s, x_m, y_m;
  };
  std::vector<Place> places;
};

/// A hall with people and the depth camera of a robot in it, 1.1 m high, 10 frames a second: the
/// simulated Xtion with its lens and noise, of which every n-th pixel in both directions. Mapped
/// in 8 x 7.2 x 2 m.
class PeopleWorld {
 public:
  static constexpr double kPeriod_s = 0.1;
  static constexpr double kRadius_m = 0.25, kHeight_m = 1.7;
  static constexpr double kLeastRange_m = 0.35, kGreatestRange_m = 5.0;

  PeopleWorld(const std::vector<Walk>& walks, std::vector<SceneObject> things = {}, int every = 4)
      : camera_(camera(every)),
        renderer_(camera_, true),
        sensor_(camera_, {kLeastRange_m, kGreatestRange_m}, noise(every), 1) {
    for (SceneObject& object : hall()) things.push_back(std::move(object));
    for (const Walk& walk : walks) {
      SceneObject person{"person", Cylinder{kRadius_m, kHeight_m}, {}, false, {}};
      for (const Walk::Place& place : walk.places) {
        Transform pose = Transform::Identity();
        pose.translation() = Eigen::Vector3d(place.x_m, place.y_m, 0.5 * kHeight_m);
        person.waypoints.push_back({place.time_s, pose});
      }
      people_.push_back(things.size());
      things.push_back(std::move(person));
    }
    scene_ = Scene(std::move(things));
    caster_ = std::make_unique<RayCaster>(scene_);
  }

  static SceneObject box(const Eigen::Vector3d& centre_m, const Eigen::Vector3d& size_m) {
    Transform pose = Transform::Identity();
    pose.translation() = centre_m;
    return {"box", Box{size_m}, {{0.0, pose}}, false, {}};
  }

  /// Where the camera looks, as an angle about the vertical.
  std::function<double(double time_s)> yaw_rad = [](double) { return 0.0; };

  /// And where it is.
  std::function<Eigen::Vector3d(double time_s)> camera_m = [](double) {
    return Eigen::Vector3d(0.0, 0.0, 1.1);
  };

  [[nodiscard]] Eigen::Vector2d position_m(std::size_t person, double time_s) const {
    const SceneObject& object = scene_.objects()[people_[person]];
    return object.T_world_object(time_s).translation().head<2>();
  }
  [[nodiscard]] Eigen::Vector2d velocity_mps(std::size_t person, double time_s) const {
    return (position_m(person, time_s) - position_m(person, time_s - 1e-3)) / 1e-3;
  }

  [[nodiscard]] const Scene& scene() const noexcept { return scene_; }
  /// Whether rays of the newest frame truly go on for half a metre behind a place, all around it.
  [[nodiscard]] bool sees_beyond(const Frame& frame, const Eigen::Vector3d& p_m) const {
    const Eigen::Vector3d eye_m = frame.T_world_camera.translation();
    const Eigen::Vector3d p_camera = frame.T_world_camera.inverse() * p_m;
    const CameraIntrinsics& image = camera_;
    const double u = image.fx_px * p_camera.x() / p_camera.z() + image.cx_px;
    const double v = image.fy_px * p_camera.y() / p_camera.z() + image.cy_px;
    constexpr double kBeside_px = 4.0;
    if (p_camera.z() < 0.5 || u < kBeside_px || v < kBeside_px || u > image.width_px - kBeside_px ||
        v > image.height_px - kBeside_px) {
      return false;
    }
    std::vector<Eigen::Vector3d> directions;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double side_m : {-0.06, 0.06}) {
        directions.push_back((p_m + side_m * Eigen::Vector3d::Unit(axis) - eye_m).normalized());
      }
    }
    std::vector<double> distances_m(directions.size());
    caster_->cast_distances(eye_m, directions, distances_m);
    return std::ranges::all_of(distances_m, [&](double distance_m) {
      return distance_m > (p_m - eye_m).norm() + 0.5 && distance_m < kGreatestRange_m;
    });
  }

  [[nodiscard]] Frame look(int number, double period_s = kPeriod_s) {
    const double time_s = period_s * number;
    caster_->set_time(time_s);
    Frame frame;
    frame.sequence = number;
    frame.stamp = Stamp::from_seconds(time_s);
    frame.T_world_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    frame.T_world_camera.linear() = Eigen::AngleAxisd(yaw_rad(time_s), Eigen::Vector3d::UnitZ()) *
                                    frame.T_world_camera.linear();
    frame.T_world_camera.translation() = camera_m(time_s);
    frame.measurement = image(frame.T_world_camera, number);
    return frame;
  }

 private:
  static std::vector<SceneObject> hall() {
    SceneObject floor{"floor", HalfSpace{}, {{0.0, Transform::Identity()}}, false, {}};
    // Where nothing is in range, rays free nothing.
    return {std::move(floor), box({4.75, 0.0, 1.25}, {0.1, 7.0, 2.5}),
            box({2.0, 2.9, 1.25}, {6.0, 0.1, 2.5}), box({2.0, -2.9, 1.25}, {6.0, 0.1, 2.5}),
            box({4.3, -2.2, 0.9}, {0.5, 0.8, 1.8})};
  }

  static simulator::NoiseOptions noise(int every) {
    simulator::NoiseOptions noise;
    noise.model = "kinect";
    // In pixels of the whole image.
    noise.lateral_sigma_px /= every;
    noise.disparity_step_px /= every;
    return noise;
  }

  static CameraIntrinsics camera(int every) {
    const simulator::CameraOptions xtion;
    const auto pixel = [every](double whole) { return (whole + 0.5) / every - 0.5; };
    return {xtion.width_px / every, xtion.height_px / every, xtion.fx_px / every,
            xtion.fy_px / every,    pixel(xtion.cx_px),      pixel(xtion.cy_px)};
  }

  [[nodiscard]] DepthImage image(const Transform& T_world_camera, int number) {
    renderer_.render(*caster_, T_world_camera, host_.workers(), exact_);
    DepthImage image{camera_, {}};
    image.depth_m.resize(static_cast<std::size_t>(image.camera.width_px) *
                         static_cast<std::size_t>(image.camera.height_px));
    sensor_.measure(exact_, number, host_.workers(), image.depth_m);
    return image;
  }

  conformance::TestHost host_{1};
  Scene scene_;
  std::vector<std::size_t> people_;
  std::unique_ptr<RayCaster> caster_;
  CameraIntrinsics camera_;
  simulator::DepthRenderer renderer_;
  simulator::DepthSensor sensor_;
  simulator::ExactImage exact_;
};

/// The map of such a world, and what is tracked in it.
class PeopleMap {
 public:
  explicit PeopleMap(double resolution_m = 0.05) : map_(options(resolution_m), host_.context()) {}

  [[nodiscard]] MapUpdate integrate(const Frame& frame) { return map_.integrate(frame).value(); }
  /// After integrate().
  std::shared_ptr<const Tracks> track(const Frame& frame) {
    const auto moving = detector_.look(map_, frame.stamp);
    auto tracks = tracker.update(map_, *moving, frame);
    detector_.remember(map_, frame.T_world_camera.translation(), frame.stamp);
    return tracks;
  }
  [[nodiscard]] voxel_grid::VoxelGrid& map() { return map_; }
  [[nodiscard]] MotionDetector& detector() { return detector_; }

  Tracker tracker;

 private:
  static voxel_grid::VoxelGridOptions options(double resolution_m) {
    voxel_grid::VoxelGridOptions options;
    options.resolution_m = resolution_m;
    options.size_vox = (Eigen::Vector3d(8.0, 7.2, 2.0) / resolution_m).array().round().cast<int>();
    options.origin_m = {-1.0, -3.6, -0.1};
    options.max_range_m = PeopleWorld::kGreatestRange_m;
    options.floor_clearance_m = 0.06;
    return options;
  }

  conformance::TestHost host_{1};
  voxel_grid::VoxelGrid map_;
  MotionDetector detector_;
};

}  // namespace sidestep::testing_support
