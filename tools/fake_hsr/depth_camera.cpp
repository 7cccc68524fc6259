#include "depth_camera.hpp"

#include <chrono>
#include <cmath>

#include <sidestep/core/index.hpp>

#include "conversions.hpp"
#include "node.hpp"

namespace sidestep::fake_hsr {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(1);

std::vector<int> shapes_seen(const RobotDescription& robot, int from_link) {
  std::vector<int> seen;
  for (std::size_t i = 0; i < robot.shapes.size(); ++i) {
    if (robot.shapes[i].link != from_link) seen.push_back(static_cast<int>(i));
  }
  return seen;
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
Scene with_shapes(const Scene& scene, const RobotDescription& robot, const std::vector<int>& seen) {
  std::vector<SceneObject> objects = scene.objects();
  for (const int index : seen) {
    objects.push_back(
        {"robot/" + std::to_string(index), robot.shapes[idx(index)].shape, {Waypoint{}}});
  }
  return Scene(std::move(objects));
}

}  // namespace

Result<std::unique_ptr<DepthCamera>> DepthCamera::create(World world, const Settings& settings) {
  const auto link = world.robot->description().link_index(kLink);
  if (!link) {
    return fail(ErrorCode::kConfig, std::string("the robot has no link '") + kLink + "'");
  }
  return std::unique_ptr<DepthCamera>(new DepthCamera(std::move(world), settings, *link));
}

DepthCamera::DepthCamera(World world, const Settings& settings, int link)
    : world_(std::move(world)),
      settings_(settings),
      link_(link),
      seen_(shapes_seen(world_.robot->description(), link)),
      workers_(1),
      caster_(with_shapes(*world_.scene, world_.robot->description(), seen_)),
      sensor_(settings.camera(), {0.3, settings.range_max_m}, {},
              static_cast<std::uint64_t>(settings.seed)),
      renderer_(settings.camera(), sensor_.needs_incidence()),
      T_world_link_(world_.robot->description().links.size()) {}

DepthCamera::~DepthCamera() = default;

void DepthCamera::start(::ros::Publisher image, ::ros::Publisher info, ::ros::Publisher cloud) {
  image_ = std::move(image);
  info_ = std::move(info);
  cloud_ = std::move(cloud);
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void DepthCamera::run(const std::stop_token& stop) {
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
    if (state && !world_.is_silent()) take(*state, next, number);
  }
}

void DepthCamera::take(const RobotState& state, Stamp stamp, std::int64_t number) {
  const RobotDescription& robot = world_.robot->description();
  world_.robot->link_poses({state.q.data(), static_cast<std::size_t>(state.q.size())},
                           T_world_link_, scratch_);
  std::vector<Transform> T_world_shape;
  for (const int index : seen_) {
    const CollisionShape& shape = robot.shapes[idx(index)];
    T_world_shape.push_back(T_world_link_[idx(shape.link)] * shape.T_link_shape);
  }
  caster_.set_time(world_.scene_time_s(stamp));
  caster_.set_poses(world_.scene->objects().size(), T_world_shape);
  renderer_.render(caster_, T_world_link_[idx(link_)], workers_, exact_);
  DepthImage image{settings_.camera(), {}};
  sensor_.measure(exact_, number, workers_, image.depth_m);
  const auto encoding = settings_.encoding == "16UC1" ? ros_messages::DepthEncoding::k16UC1
                                                      : ros_messages::DepthEncoding::k32FC1;
  info_.publish(ros_messages::to_camera_info(image.camera, stamp, kFrame));
  image_.publish(ros_messages::to_image(image, encoding, stamp, kFrame));
  if (cloud_) cloud_.publish(ros_messages::to_point_cloud(points_of(image), stamp, kFrame));
}

}  // namespace sidestep::fake_hsr
