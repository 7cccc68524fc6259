#pragma once

#include <functional>
#include <memory>
#include <thread>

#include <ros/publisher.h>

#include <sidestep/core/scratch.hpp>
#include <sidestep/core/worker_pool.hpp>
#include <sidestep/geometry/ray_caster.hpp>
#include <sidestep/robot/kinematic_tree.hpp>
#include <sidestep/trajectory/robot_motion.hpp>

#include "depth_sensor.hpp"
#include "settings.hpp"

namespace sidestep::fake_hsr {

/// The head's depth camera: renders the scene and the robot's own shapes from where the robot truly
/// is, in a thread of its own, and publishes what it sees.
class DepthCamera {
 public:
  struct World {
    std::shared_ptr<const KinematicTree> robot;
    std::shared_ptr<const Scene> scene;
    std::shared_ptr<const RobotMotion> motion;  ///< On ROS's clock.
    std::function<double(Stamp)> scene_time_s;  ///< [any]
    std::function<bool()> is_silent;            ///< [any]
  };

  /// Fails with kConfig where the robot has no link `head_rgbd_sensor_link`.
  [[nodiscard]] static Result<std::unique_ptr<DepthCamera>> create(World world,
                                                                   const Settings& settings);
  ~DepthCamera();

  /// `cloud` may be none.
  void start(::ros::Publisher image, ::ros::Publisher info, ::ros::Publisher cloud);

  static constexpr const char* kLink = "head_rgbd_sensor_link";
  static constexpr const char* kFrame = "head_rgbd_sensor_rgb_frame";

 private:
  DepthCamera(World world, const Settings& settings, int link);
  void run(const std::stop_token& stop);
  void take(const RobotState& state, Stamp stamp, std::int64_t number);

  World world_;
  Settings settings_;
  int link_;
  std::vector<int> seen_;  ///< Indices of the robot's shapes.
  WorkerPool workers_;
  RayCaster caster_;
  simulator::DepthSensor sensor_;
  simulator::DepthRenderer renderer_;
  simulator::ExactImage exact_;
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
  ::ros::Publisher image_;
  ::ros::Publisher info_;
  ::ros::Publisher cloud_;
  std::jthread thread_;
};

}  // namespace sidestep::fake_hsr
