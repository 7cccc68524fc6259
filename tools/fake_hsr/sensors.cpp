#include "sensors.hpp"

#include <chrono>
#include <cmath>
#include <utility>

#include <sidestep/core/index.hpp>

#include "conversions.hpp"
#include "node.hpp"

namespace sidestep::fake_hsr {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(1);

const simulator::LaserOptions kLaser;
constexpr simulator::Range kLaserRange{0.05, 20.0};
constexpr double kCameraNear_m = 0.35;
constexpr double kCameraLatency_s = 0.04;  // from exposure to topic

simulator::NoiseOptions noise_of(const Settings& settings) {
  simulator::NoiseOptions noise;
  if (!settings.is_ideal) noise.model = "kinect";
  return noise;
}

/// What has a return, in the camera's optical frame.
PointCloud points_of(const DepthImage& image) {
  PointCloud cloud;
  const CameraIntrinsics& camera = image.camera;
  for (int v = 0; v < camera.height_px; ++v) {
    for (int u = 0; u < camera.width_px; ++u) {
      const float depth_m = image.at(u, v);
      if (!std::isfinite(depth_m) || depth_m <= 0.0F) continue;
      cloud.points_m.emplace_back(camera.unproject(u, v, depth_m).cast<float>());
    }
  }
  return cloud;
}

/// The scene, and behind its objects the robot's shapes.
Scene with_shapes(const Scene& scene, const std::vector<SceneObject>& shapes) {
  std::vector<SceneObject> objects = scene.objects();
  objects.insert(objects.end(), shapes.begin(), shapes.end());
  return Scene(std::move(objects));
}

/// Of a link, looking out of what it is built into.
simulator::SeenRobot seen_from(const std::shared_ptr<const KinematicTree>& robot, int link) {
  simulator::SeenRobot seen(robot, link);
  const Eigen::VectorXd q = Eigen::VectorXd::Zero(robot->description().dof());
  std::vector<Transform> T_world_link(robot->description().links.size());
  Scratch scratch;
  robot->link_poses(as_span(q), T_world_link, scratch);
  seen.look_out_of(T_world_link, T_world_link[idx(link)].translation());
  return seen;
}

}  // namespace

Sensors::Eye::Eye(const World& world, int carrier)
    : link(carrier),
      seen(seen_from(world.robot, carrier)),
      caster(with_shapes(*world.scene, seen.shapes())) {}

Transform Sensors::Eye::open(const World& world, std::span<const Transform> T_world_link,
                             Stamp stamp) {
  simulator::View view;
  seen.place(T_world_link, view);
  caster.set_time(world.scene_time_s(stamp));
  caster.set_poses(world.scene->objects().size(), view.T_world_shape);
  return T_world_link[idx(link)];
}

Result<std::unique_ptr<Sensors>> Sensors::create(World world, const Settings& settings) {
  const RobotDescription& robot = world.robot->description();
  const auto camera = robot.link_index(kCameraLink), laser = robot.link_index(kLaserLink);
  if (!camera || !laser) {
    return fail(ErrorCode::kConfig,
                std::string("the robot has no link '") + (camera ? kLaserLink : kCameraLink) + "'");
  }
  return std::unique_ptr<Sensors>(new Sensors(std::move(world), settings, *camera, *laser));
}

Sensors::Sensors(World world, const Settings& settings, int camera_link, int laser_link)
    : world_(std::move(world)),
      settings_(settings),
      workers_(1),
      camera_(world_, camera_link),
      laser_(world_, laser_link),
      sensor_(settings.camera(), {kCameraNear_m, settings.range_max_m}, noise_of(settings),
              static_cast<std::uint64_t>(settings.seed)),
      renderer_(settings.camera(), sensor_.needs_incidence()),
      scanner_(kLaser, kLaserRange, static_cast<std::uint64_t>(settings.seed)),
      T_world_link_(world_.robot->description().links.size()) {}

void Sensors::start(Publishers publishers) {
  publishers_ = std::move(publishers);
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void Sensors::run(const std::stop_token& stop) {
  const std::int64_t period_ns = Stamp::from_seconds(1.0 / settings_.camera_rate_hz).ns;
  Stamp next = ros1_node::ros_now();
  for (std::int64_t number = 0; !stop.stop_requested(); ++number) {
    next.ns += period_ns;
    // One that fell behind goes on with the newest.
    const Stamp now = ros1_node::ros_now();
    if (next.ns + period_ns < now.ns) next = now;
    std::optional<RobotState> state;
    while (!stop.stop_requested() && !(state = world_.motion->truth(next))) {
      std::this_thread::sleep_for(kPoll);
      const auto newest = world_.motion->newest();
      if (newest && newest->ns > next.ns + period_ns) break;
    }
    if (state) take(*state, next, number);
  }
}

void Sensors::take(const RobotState& state, Stamp stamp, std::int64_t number) {
  world_.robot->link_poses(as_span(state.q), T_world_link_, scratch_);
  if (!world_.is_silent("laser")) take_scan(stamp, number);
  if (!world_.is_silent("camera")) take_image(stamp, number);
}

void Sensors::take_image(Stamp stamp, std::int64_t number) {
  const Transform T_world_camera = camera_.open(world_, T_world_link_, stamp);
  renderer_.render(camera_.caster, T_world_camera, workers_, exact_);
  DepthImage image{settings_.camera(), {}};
  sensor_.measure(exact_, number, workers_, image.depth_m);
  const auto encoding = settings_.encoding == "16UC1" ? ros_messages::DepthEncoding::k16UC1
                                                      : ros_messages::DepthEncoding::k32FC1;
  const double early_s = stamp.seconds() + kCameraLatency_s - ros1_node::ros_now().seconds();
  if (!settings_.is_ideal && early_s > 0.0) {
    std::this_thread::sleep_for(std::chrono::duration<double>(early_s));
  }
  publishers_.info.publish(ros_messages::to_camera_info(image.camera, stamp, kCameraFrame));
  publishers_.image.publish(ros_messages::to_image(image, encoding, stamp, kCameraFrame));
  if (!publishers_.cloud) return;
  publishers_.cloud.publish(ros_messages::to_point_cloud(points_of(image), stamp, kCameraFrame));
}

void Sensors::take_scan(Stamp stamp, std::int64_t number) {
  const Transform T_world_laser = laser_.open(world_, T_world_link_, stamp);
  PointCloud scan;
  scanner_.scan(laser_.caster, T_world_laser, number, scan.points_m);
  publishers_.scan.publish(ros_messages::to_laser_scan(scan, kLaser.from_rad, kLaser.to_rad,
                                                       {kLaserRange.min_m, kLaserRange.max_m},
                                                       stamp, kLaserLink));
}

}  // namespace sidestep::fake_hsr
