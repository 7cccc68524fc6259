#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>

#include <ros/publisher.h>

#include <sidestep/core/scratch.hpp>
#include <sidestep/core/worker_pool.hpp>
#include <sidestep/geometry/ray_caster.hpp>
#include <sidestep/robot/kinematic_tree.hpp>
#include <sidestep/trajectory/robot_motion.hpp>

#include "depth_sensor.hpp"
#include "laser_scanner.hpp"
#include "settings.hpp"
#include "viewpoint.hpp"

namespace sidestep::fake_hsr {

/// The head's depth camera and the base's laser: each sees the scene and the robot's own shapes
/// from where the robot truly is. Taken together, at the camera's rate, in a thread of their own.
class Sensors {
 public:
  struct World {
    std::shared_ptr<const KinematicTree> robot;
    std::shared_ptr<const Scene> scene;
    std::shared_ptr<const RobotMotion> motion;               ///< On ROS's clock.
    std::function<double(Stamp)> scene_time_s;               ///< [any]
    std::function<bool(const std::string& part)> is_silent;  ///< [any]
  };
  struct Publishers {
    ::ros::Publisher image, info;
    ::ros::Publisher cloud;  ///< May be none.
    ::ros::Publisher scan;
  };

  /// Fails with kConfig where the robot lacks a link that carries one of them.
  [[nodiscard]] static Result<std::unique_ptr<Sensors>> create(World world,
                                                               const Settings& settings);

  void start(Publishers publishers);

  static constexpr const char* kCameraLink = "head_rgbd_sensor_link";
  static constexpr const char* kCameraFrame = "head_rgbd_sensor_rgb_frame";
  static constexpr const char* kLaserLink = "base_range_sensor_link";

 private:
  /// What one of them sees through.
  struct Eye {
    Eye(const World& world, int carrier);
    /// Moves all to where it is; the link's pose.
    Transform open(const World& world, std::span<const Transform> T_world_link, Stamp stamp);

    int link;
    simulator::SeenRobot seen;
    RayCaster caster;
  };

  Sensors(World world, const Settings& settings, int camera_link, int laser_link);
  void run(const std::stop_token& stop);
  void take(const RobotState& state, Stamp stamp, std::int64_t number);
  void take_image(Stamp stamp, std::int64_t number);
  void take_scan(Stamp stamp, std::int64_t number);

  World world_;
  Settings settings_;
  WorkerPool workers_;
  Eye camera_, laser_;
  simulator::DepthSensor sensor_;
  simulator::DepthRenderer renderer_;
  simulator::ExactImage exact_;
  simulator::LaserScanner scanner_;
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
  Publishers publishers_;
  std::jthread thread_;
};

}  // namespace sidestep::fake_hsr
