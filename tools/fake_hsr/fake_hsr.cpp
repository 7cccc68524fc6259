#include "fake_hsr.hpp"

#include <cmath>
#include <cstdio>

#include <boost/function.hpp>
#include <nlohmann/json.hpp>

#include <sidestep/core/index.hpp>
#include <sidestep/geometry/crowd.hpp>
#include <sidestep/geometry/load_scene.hpp>
#include <sidestep/runtime/install_layout.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "controller_state.hpp"
#include "conversions.hpp"
#include "node.hpp"
#include "profile_robot.hpp"
#include "simulator.hpp"

namespace sidestep::fake_hsr {
namespace {

using ros1_node::ros_now;

/// Between two poses that are judged: 125 Hz.
constexpr std::int64_t kTruthPeriod_ns = 8'000'000;
constexpr std::uint32_t kQueueLength = 10;
/// Of the drives: when they act, and the lag with which they see a trajectory.
constexpr double kDelay_s = 0.05, kLag_s = 0.08;
/// Of odometry: of the way, and of each metre.
constexpr double kDriftShare = 0.01, kDrift_radpm = 0.01745;
constexpr double kServe_s = 0.002;
/// Slower than this, m/s or rad/s, a robot stands.
constexpr double kStanding = 1e-3;

const std::vector<std::string> kBaseJoints{"odom_x", "odom_y", "odom_t"};
const std::vector<std::string> kArmJoints{"arm_lift_joint", "arm_flex_joint", "arm_roll_joint",
                                          "wrist_flex_joint", "wrist_roll_joint"};
const std::vector<std::string> kHeadJoints{"head_pan_joint", "head_tilt_joint"};
constexpr const char* kBaseFrame = "base_footprint";
constexpr const char* kWorldFrame = "odom";

/// The head's joints, which the profile fixes: limits as the robot's URDF has them.
std::vector<Joint> head_joints() {
  Joint pan{kHeadJoints[0], Joint::Type::kRevolute, -3.84, 1.75, 1.0, 2.0};
  Joint tilt{kHeadJoints[1], Joint::Type::kRevolute, -1.57, 0.52, 1.0, 2.0};
  return {pan, tilt};
}

/// The pose's positions, those of `joints` over them, and the head as the profile has it.
Result<Eigen::VectorXd> start_of(const RobotDescription& planned, const KinematicTree& tree,
                                 const RobotDescription& robot, const Settings& settings) {
  Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.dof());
  for (const TreeJoint& joint : tree.tree_joints()) {
    const auto index = robot.joint_index(joint.name);
    if (index && joint.joint == -1) q[*index] = joint.offset;
  }
  const NamedPose* const pose = planned.find_pose(settings.pose);
  if (pose == nullptr) {
    return fail(ErrorCode::kConfig,
                "robot '" + planned.name + "' has no pose '" + settings.pose + "'");
  }
  for (std::size_t j = 0; j < pose->positions.size(); ++j) {
    if (pose->positions[j]) q[static_cast<Eigen::Index>(j)] = *pose->positions[j];
  }
  for (const std::string& entry : settings.joints) {
    const std::size_t equals = entry.find('=');
    const auto index = robot.joint_index(entry.substr(0, equals));
    char* end = nullptr;
    const double value =
        equals == std::string::npos ? 0.0 : std::strtod(entry.c_str() + equals + 1, &end);
    if (!index || end == nullptr || *end != '\0' || !std::isfinite(value)) {
      return fail(ErrorCode::kConfig, "'" + entry + "' is not JOINT=POSITION", "--joint");
    }
    q[*index] = value;
  }
  return q;
}

}  // namespace

Result<std::unique_ptr<FakeHsr>> FakeHsr::create(const Settings& settings) {
  const auto loaded = SIDESTEP_TRY(load_profile_robot(settings.profile));
  const KinematicTree& tree = *loaded.tree;
  const auto robot = SIDESTEP_TRY(with_joints(tree, head_joints()));
  const YamlDocumentReader documents;
  const auto scene =
      SIDESTEP_TRY(load_scene(settings.scene, {install_layout().configs / "scenes"}, documents));
  const auto q = SIDESTEP_TRY(start_of(tree.description(), tree, robot->description(), settings));

  const auto drawn = SIDESTEP_TRY(scene.drawn(static_cast<std::uint64_t>(settings.seed)));
  std::unique_ptr<FakeHsr> fake(
      new FakeHsr(settings, robot, std::make_shared<const Scene>(walked(drawn)), q));
  if (!settings.is_ideal) {
    fake->drift_ = SIDESTEP_TRY(simulated::Drift::create(
        kDriftShare, kDrift_radpm, *robot, static_cast<std::uint64_t>(settings.seed)));
  }
  for (const std::string& text : settings.silences) {
    fake->silences_.push_back(SIDESTEP_TRY(parse_silence(text)));
  }
  fake->sensors_ = SIDESTEP_TRY(Sensors::create(
      {fake->robot_, fake->scene_, fake->motion_,
       [raw = fake.get()](Stamp stamp) { return raw->scene_time_s(stamp); },
       [raw = fake.get()](const std::string& part) { return raw->is_part_silent(part); }},
      settings));
  fake->connect();
  return fake;
}

FakeHsr::FakeHsr(const Settings& settings, std::shared_ptr<const KinematicTree> robot,
                 std::shared_ptr<const Scene> scene, const Eigen::VectorXd& q)
    : settings_(settings),
      robot_(std::move(robot)),
      scene_(std::move(scene)),
      motion_(std::make_shared<RobotMotion>()),
      state_{q, Eigen::VectorXd::Zero(q.size())},
      begin_(ros_now()),
      next_truth_(begin_),
      next_publish_(begin_),
      T_world_link_(robot_->description().links.size()) {
  node_.setCallbackQueue(&queue_);
  const RobotDescription& description = robot_->description();
  const double delay_s = settings.is_ideal ? 0.0 : kDelay_s;
  const double lag_s = settings.is_ideal ? 0.0 : kLag_s;
  const auto add = [&](const char* name, const std::vector<std::string>& joints) {
    controllers_.push_back(std::unique_ptr<Controller>(
        new Controller{name, JointGroup(description, joints, q, begin_, delay_s, lag_s), {}, {}}));
  };
  add("omni_base_controller", kBaseJoints);  // the first: on_twist()
  add("arm_trajectory_controller", kArmJoints);
  add("head_trajectory_controller", kHeadJoints);
}

void FakeHsr::connect() {
  const std::string& prefix = settings_.prefix;
  using ros_messages::JointTrajectory;
  using Pointer = boost::shared_ptr<const JointTrajectory>;
  const boost::function<void(const boost::shared_ptr<const ros_messages::Twist>&)> drive(
      [this](const auto& message) { on_twist(*message); });
  twist_ = node_.subscribe<ros_messages::Twist>(prefix + "/command_velocity", kQueueLength, drive,
                                                ::ros::VoidConstPtr(),
                                                ::ros::TransportHints().tcpNoDelay());
  for (const auto& controller : controllers_) {
    const std::string topic = prefix + "/" + controller->name;
    controller->state = node_.advertise<ControllerState>(topic + "/state", 1);
    const boost::function<void(const Pointer&)> call(
        [this, raw = controller.get()](const Pointer& message) { on_command(*raw, *message); });
    controller->command = node_.subscribe<JointTrajectory>(topic + "/command", kQueueLength, call,
                                                           ::ros::VoidConstPtr(),
                                                           ::ros::TransportHints().tcpNoDelay());
  }
  publishers_["joint_states"] =
      node_.advertise<ros_messages::JointState>(prefix + "/joint_states", kQueueLength);
  publishers_["odom"] = node_.advertise<ros_messages::Odometry>(prefix + "/odom", kQueueLength);
  publishers_["tf"] = node_.advertise<ros_messages::TfMessage>("/tf", kQueueLength);
  publishers_["tf_static"] = node_.advertise<ros_messages::TfMessage>("/tf_static", 1, true);
  publish_static_transforms();
  const std::string sensor = prefix + "/head_rgbd_sensor";
  sensors_->start(
      {node_.advertise<ros_messages::Image>(sensor + "/depth_registered/image_rect_raw", 1),
       node_.advertise<ros_messages::CameraInfo>(sensor + "/rgb/camera_info", 1),
       settings_.clouds ? node_.advertise<ros_messages::PointCloud2>(
                              sensor + "/depth_registered/rectified_points", 1)
                        : ::ros::Publisher(),
       node_.advertise<ros_messages::LaserScan>(prefix + "/base_scan", 1)});
}

void FakeHsr::on_command(Controller& controller, const ros_messages::JointTrajectory& message) {
  if (is_part_silent("controller")) return;
  const Stamp now = ros_now();
  if (auto followed = controller.group.follow(message, now); !followed) {
    ++refused_commands_;
    std::fprintf(stderr, "%s refuses a command: %s\n", controller.name.c_str(),
                 followed.error().describe().c_str());
    return;
  }
  ++controller.commands;
  if (first_command_ns_ == 0) first_command_ns_ = now.ns;
}

void FakeHsr::on_twist(const ros_messages::Twist& message) {
  if (is_part_silent("controller")) return;
  const Stamp now = ros_now();
  controllers_.front()->group.drive(message, now);
  ++twists_;
  if (first_command_ns_ == 0) first_command_ns_ = now.ns;
}

double FakeHsr::scene_time_s(Stamp stamp) const {
  const std::int64_t zero_ns = settings_.scene_waits ? first_command_ns_.load() : begin_.ns;
  if (zero_ns == 0) return 0.0;
  return std::max(0.0, 1e-9 * static_cast<double>(stamp.ns - zero_ns));
}

bool FakeHsr::is_part_silent(const std::string& part) const {
  const std::int64_t first_ns = first_command_ns_;
  std::optional<double> since_s;
  if (first_ns != 0) since_s = 1e-9 * static_cast<double>(ros_now().ns - first_ns);
  return is_silent(silences_, part, since_s);
}

void FakeHsr::run(const std::atomic<bool>& end) {
  while (!end && ::ros::ok()) {
    queue_.callAvailable(::ros::WallDuration(kServe_s));
    const Stamp now = ros_now();
    advance(now);
    if (now >= next_publish_) publish(now);
  }
}

void FakeHsr::advance(Stamp now) {
  const bool is_dead = is_part_silent("controller");
  for (const auto& controller : controllers_) {
    // Drives that nobody controls brake.
    if (is_dead && !controller->was_silent) controller->group.brake(now);
    controller->was_silent = is_dead;
  }
  // In small steps, whatever the loop's rate: what moves in between is judged, too.
  constexpr std::int64_t kStep_ns = 4'000'000;
  const Stamp last = motion_->newest().value_or(begin_);
  for (Stamp at{std::min(last.ns + kStep_ns, now.ns)};;
       at.ns = std::min(at.ns + kStep_ns, now.ns)) {
    const Eigen::VectorXd before = state_.q;
    for (const auto& controller : controllers_) controller->group.advance(at, state_);
    drift_.step(before, state_.q);
    const RobotState truth = drift_.truth(state_);
    motion_->record_truth(truth, at);
    motion_->record(state_, at);
    // A head that looks around is no robot that moves.
    const double speed =
        state_.qdot.head(state_.qdot.size() - std::ssize(kHeadJoints)).cwiseAbs().maxCoeff();
    note_motion(speed > kStanding, at);
    if (at >= next_truth_) {
      if (first_command_ns_ != 0 || poses_.empty()) {
        poses_.push_back({scene_time_s(at), truth.q});
        speeds_.push_back(speed);
      }
      next_truth_ = {at.ns + kTruthPeriod_ns};
    }
    if (at >= now) return;
  }
}

void FakeHsr::note_motion(bool is_moving, Stamp stamp) {
  if (is_moving && !is_moving_) std::fprintf(stderr, "fake_hsr: motion %d begins\n", ++motions_);
  if (!is_moving && is_moving_) std::fprintf(stderr, "fake_hsr: motion %d ends\n", motions_);
  if (is_moving) last_moved_ = stamp;
  is_moving_ = is_moving;
}

void FakeHsr::publish(Stamp now) {
  const std::int64_t period_ns = Stamp::from_seconds(1.0 / settings_.state_rate_hz).ns;
  next_publish_ = {std::max(next_publish_.ns + period_ns, now.ns)};
  if (!is_part_silent("joint_states")) publish_joint_states(now);
  if (!is_part_silent("odom")) publish_odometry(now);
  if (!is_part_silent("tf")) publish_transforms(now);
  if (!is_part_silent("controller")) publish_controllers(now);
}

void FakeHsr::publish_joint_states(Stamp stamp) {
  const RobotDescription& robot = robot_->description();
  ros_messages::JointState message;
  message.header.stamp = ros_messages::to_ros_time(stamp);
  for (const auto* joints : {&kArmJoints, &kHeadJoints}) {
    for (const std::string& name : *joints) {
      const int index = robot.joint_index(name).value();
      message.name.push_back(name);
      message.position.push_back(state_.q[index]);
      message.velocity.push_back(state_.qdot[index]);
      message.effort.push_back(0.0);
    }
  }
  publishers_["joint_states"].publish(message);
}

void FakeHsr::publish_odometry(Stamp stamp) {
  ros_messages::Odometry message;
  message.header.stamp = ros_messages::to_ros_time(stamp);
  message.header.frame_id = kWorldFrame;
  message.child_frame_id = kBaseFrame;
  const double yaw = state_.q[2];
  message.pose.pose.position.x = state_.q[0];
  message.pose.pose.position.y = state_.q[1];
  message.pose.pose.orientation.w = std::cos(0.5 * yaw);
  message.pose.pose.orientation.z = std::sin(0.5 * yaw);
  const Eigen::Vector2d v_base =
      Eigen::Rotation2Dd(-yaw) * Eigen::Vector2d(state_.qdot[0], state_.qdot[1]);
  message.twist.twist.linear.x = v_base.x();
  message.twist.twist.linear.y = v_base.y();
  message.twist.twist.angular.z = state_.qdot[2];
  publishers_["odom"].publish(message);
}

/// Of every link of the robot against its parent; the virtual ones of its base are the odometry.
void FakeHsr::publish_transforms(Stamp stamp) {
  const RobotDescription& robot = robot_->description();
  robot_->link_poses({state_.q.data(), static_cast<std::size_t>(state_.q.size())}, T_world_link_,
                     scratch_);
  const int base = robot.link_index(kBaseFrame).value();
  ros_messages::TfMessage message;
  for (int link = base; link < static_cast<int>(robot.links.size()); ++link) {
    const auto i = static_cast<std::size_t>(link);
    const int parent = link == base ? -1 : robot.links[i].parent;
    const Transform T_parent_link =
        parent == -1 ? T_world_link_[i] : T_world_link_[idx(parent)].inverse() * T_world_link_[i];
    message.transforms.push_back(ros_messages::to_transform(
        ros_messages::rigid_pose(T_parent_link), stamp,
        parent == -1 ? kWorldFrame : robot.links[idx(parent)].name, robot.links[i].name));
  }
  publishers_["tf"].publish(message);
}

void FakeHsr::publish_static_transforms() {
  ros_messages::TfMessage message;
  message.transforms.push_back(
      ros_messages::to_transform({}, ros_now(), Sensors::kCameraLink, Sensors::kCameraFrame));
  publishers_["tf_static"].publish(message);
}

void FakeHsr::publish_controllers(Stamp stamp) {
  for (const auto& controller : controllers_) {
    ControllerState message;
    message.header.stamp = ros_messages::to_ros_time(stamp);
    const auto& names = controller->group.joints();
    message.joint_names.assign(names.begin(), names.end());
    const RobotState& state = controller->group.state();
    message.actual.positions.assign(state.q.begin(), state.q.end());
    message.actual.velocities.assign(state.qdot.begin(), state.qdot.end());
    controller->state.publish(message);
  }
}

std::string FakeHsr::silences_json() const {
  nlohmann::ordered_json list = nlohmann::json::array();
  const double zero_s = scene_time_s({first_command_ns_});
  for (const Silence& silence : silences_) {
    nlohmann::ordered_json entry{{"part", silence.part},
                                 {"from_s", silence.from_s},
                                 {"speed_then", nullptr},
                                 {"at_rest_after_s", nullptr}};
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      const double since_s = poses_[i].time_s - zero_s - silence.from_s;
      if (since_s < 0.0) continue;
      if (entry["speed_then"].is_null()) entry["speed_then"] = speeds_[i];
      if (speeds_[i] > kStanding) continue;
      entry["at_rest_after_s"] = since_s;
      break;
    }
    list.push_back(std::move(entry));
  }
  return list.dump();
}

std::string FakeHsr::end_json() const {
  const RobotDescription& robot = robot_->description();
  const RobotState truth = drift_.truth(state_);
  nlohmann::ordered_json json;
  for (int j = 0; j < robot.dof(); ++j) {
    const std::string& name = robot.joints[idx(j)].name;
    json["joints"][name] = truth.q[j];
    json["speeds"][name] = truth.qdot[j];
  }
  std::vector<Transform> T_world_link(robot.links.size());
  Scratch scratch;
  robot_->link_poses(as_span(truth.q), T_world_link, scratch);
  for (std::size_t i = 0; i < T_world_link.size(); ++i) {
    const Eigen::Vector3d p_m = T_world_link[i].translation();
    json["links_m"][robot.links[i].name] = {p_m.x(), p_m.y(), p_m.z()};
  }
  return json.dump();
}

Result<std::string> FakeHsr::summary() const {
  TrueMotionSettings settings;
  for (const std::string& entry : settings_.allowed) {
    const std::size_t colon = entry.find(':');
    if (colon == std::string::npos) {
      return fail(ErrorCode::kConfig, "'" + entry + "' is not LINK:OBJECT", "--allow");
    }
    settings.allowed_contacts.push_back({entry.substr(0, colon), entry.substr(colon + 1)});
  }
  const auto truth = SIDESTEP_TRY(check_true_motion(robot_, scene_, poses_, settings));
  nlohmann::ordered_json json;
  json["collisions_true"] = truth.contacts.size();
  json["min_true_clearance_m"] = truth.min_clearance_m;
  json["nearest"] = {
      {"link", truth.nearest_link}, {"object", truth.nearest_object}, {"time_s", truth.nearest_s}};
  json["duration_s"] = poses_.empty() ? 0.0 : poses_.back().time_s;
  json["poses_judged"] = poses_.size();
  for (const auto& controller : controllers_) {
    json["commands"][controller->name] = controller->commands;
  }
  json["commands"]["command_velocity"] = twists_;
  json["commands_refused"] = refused_commands_;
  json["contacts"] = nlohmann::json::array();
  for (const TrueContact& contact : truth.contacts) {
    json["contacts"].push_back({{"link", contact.link},
                                {"object", contact.object},
                                {"begin_s", contact.begin_s},
                                {"end_s", contact.end_s},
                                {"depth_m", contact.depth_m}});
  }
  json["silences"] = nlohmann::ordered_json::parse(silences_json());
  json["first_command_unix_s"] = Stamp{first_command_ns_}.seconds();
  json["last_moved_unix_s"] = last_moved_.seconds();
  json["at_end"] = nlohmann::ordered_json::parse(end_json());
  json["speed_at_end"] = state_.qdot.cwiseAbs().maxCoeff();
  return json.dump(2) + "\n";
}

}  // namespace sidestep::fake_hsr
