#include "run_bag.hpp"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include <sidestep/core/index.hpp>

#include "run_messages.hpp"
#include "view_messages.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

constexpr ros::ColorRGBA kBaseColour{0.1F, 0.4F, 0.9F, 1.0F};
constexpr ros::ColorRGBA kToolColour{0.1F, 0.7F, 0.3F, 1.0F};
constexpr ros::ColorRGBA kRefusedColour{0.9F, 0.2F, 0.2F, 0.6F};

std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::vector<double> numbers(const Eigen::VectorXd& q) { return {q.begin(), q.end()}; }

Json json_of(const ObservedEvent& observed) {
  const ReplannerEvent& event = observed.event;
  Json json = event_json(observed);
  json["time_s"] = event.stamp.seconds();
  json["splice_velocity_jump"] = event.splice_velocity_jump;
  json["unknown_share"] = event.unknown_share;
  return json;
}

/// `time`, or just after the last one: readers disagree on the order of what has the same time.
ros::Time next_time(ros::Time time, ros::Time last) {
  return std::max(time, ros_time(Stamp{run_stamp(last).ns + 1}));
}

/// "camera_optical_frame", or with a dash more where a link has that name.
std::string camera_frame_beside(const RobotDescription& robot) {
  std::string name = "camera_optical_frame";
  while (robot.link_index(name)) name += "_";
  return name;
}

}  // namespace

Result<RunBag> RunBag::create(const std::filesystem::path& file) {
  auto writer = SIDESTEP_TRY(bag::Writer::create(file));
  return RunBag(std::move(writer));
}

void RunBag::begin(const ObservedWorld& world) {
  if (has_begun_) {  // Nobody has ended the one before.
    if (waiting_map_) put_map(waiting_map_stamp_);
    move_epoch();
  }
  has_begun_ = true;
  is_shown_ = has_stepped_ = false;
  world_ = world;
  followed_ = nullptr;
  for (Throttle* const throttle : {&transforms_, &maps_, &moving_}) throttle->restart();
  camera_frame_ = camera_frame_beside(world.robot->description());
}

void RunBag::show_world(Stamp first) {
  if (is_shown_ || !world_.robot) return;
  is_shown_ = true;
  const RobotDescription& robot = world_.robot->description();
  const ros::Time time = time_of(first);
  put_event(time, text_of({{"event", "begin"},
                           {"time_s", first.seconds()},
                           {"title", world_.title},
                           {"episode", world_.episode},
                           {"robot", robot.name},
                           {"epoch_s", epoch_.seconds()},
                           {"q_start", numbers(world_.q_start)},
                           {"q_goal", numbers(world_.q_goal)}}));
  put(topics::kRobot, time, sphere_markers(robot, time), true);
  if (!world_.scene) return;
  put(topics::kScene, time, object_markers(*world_.scene, false, first.seconds(), time), true);
}

void RunBag::seen(const Frame& frame, Stamp received) {
  show_world(frame.stamp);
  const ros::Time time = time_of(received);
  if (camera_frame_.empty()) camera_frame_ = camera_frame_beside({});
  const ros::Header header{0, time_of(frame.stamp), camera_frame_};
  if (const auto* const depth = std::get_if<DepthImage>(&frame.measurement)) {
    put(topics::kDepth, time, depth_image(*depth, header));
    put(topics::kCameraInfo, time, camera_info(depth->camera, header));
  } else {
    put(topics::kPoints, time, point_cloud(std::get<PointCloud>(frame.measurement), header));
  }
  ros::TFMessage to_camera;
  ros::TransformStamped& transform = to_camera.transforms.emplace_back();
  transform.header = {0, header.stamp, kWorldFrame};
  transform.child_frame_id = camera_frame_;
  transform.transform = ros_transform(frame.T_world_camera);
  put(topics::kTransforms, header.stamp, to_camera);
  if (has_stepped_ || !world_.robot) return;
  // Nobody has measured it yet.
  const Eigen::VectorXd& q = frame.joint_positions ? *frame.joint_positions : world_.q_start;
  put_robot(as_span(q), frame.stamp);
}

void RunBag::put_robot(std::span<const double> q, Stamp stamp) {
  const RobotDescription& robot = world_.robot->description();
  if (static_cast<int>(q.size()) != robot.dof()) return;
  const ros::Time time = time_of(stamp);
  put(topics::kJointStates, time, joint_state(robot, q, time));
  if (!transforms_.lets_through(stamp)) return;
  std::vector<Transform> T_world_link(robot.links.size());
  world_.robot->link_poses(q, T_world_link, scratch_);
  put(topics::kTransforms, time, link_transforms(robot, T_world_link, time));
}

void RunBag::mapped(const MapSnapshot& map, Stamp published) {
  if (map.field == nullptr) return;
  show_world(published);
  waiting_map_ = map.field;
  waiting_map_stamp_ = published;
  if (maps_.lets_through(published)) put_map(published);
}

void RunBag::put_map(Stamp stamp) {
  if (voxels_.update(std::exchange(waiting_map_, nullptr)).any()) {
    put(topics::kMap, time_of(stamp), voxel_markers(voxels_, time_of(stamp)), true);
  }
}

void RunBag::stepped(const ObservedStep& step) {
  show_world(step.stamp);
  has_stepped_ = true;
  if (world_.robot && step.q.size() > 0) put_robot(as_span(step.q), step.stamp);
  const bool anything_moves =
      world_.scene && std::ranges::any_of(world_.scene->objects(), &SceneObject::moves);
  if (anything_moves && moving_.lets_through(step.stamp)) {
    const ros::Time time = time_of(step.stamp);
    put(topics::kMoving, time, object_markers(*world_.scene, true, step.stamp.seconds(), time));
  }
}

void RunBag::happened(const ObservedEvent& event) {
  show_world(event.event.stamp);
  const ros::Time time = time_of(event.event.stamp);
  put_event(time, text_of(json_of(event)));
  if (!world_.robot) return;
  if (event.followed) {
    followed_ = event.followed;
    put(topics::kTrajectory, time,
        joint_trajectory(world_.robot->description(), *followed_, time_of(event.followed_start)),
        true);
  }
  if (event.followed || event.event.refused) put_paths(time, event.event.refused.get());
}

void RunBag::put_paths(ros::Time time, const Trajectory* refused) {
  std::vector<DrawnMotion> motions;
  if (followed_) motions.push_back({"followed", *followed_, kBaseColour, kToolColour});
  if (refused != nullptr) motions.push_back({"refused", *refused, kRefusedColour, kRefusedColour});
  put(topics::kPaths, time, path_markers(*world_.robot, motions, time), true);
}

void RunBag::end(const ObservedEnd& end) {
  show_world(end.stamp);
  if (waiting_map_) put_map(waiting_map_stamp_);
  for (const TrueContact& contact : end.contacts) {
    Json json = contact_json(contact);
    json["time_s"] = contact.begin_s;
    put_event(time_of(end.stamp), text_of(json));
  }
  put_event(time_of(end.stamp), text_of({{"event", "end"},
                                         {"time_s", end.stamp.seconds()},
                                         {"success", end.success},
                                         {"verdict", end.verdict}}));
  // What comes before the next episode's begin is of the next one.
  move_epoch();
  has_begun_ = false;
}

void RunBag::move_epoch() noexcept {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  epoch_ = Stamp{(std::int64_t{last_time_.sec} + 2) * kSecond_ns};
}

void RunBag::viewed(Stamp stamp, std::string_view message) {
  last_view_ = next_time(time_of(stamp), last_view_);
  put(topics::kView, last_view_, byte_array(std::as_bytes(std::span(message))));
}

void RunBag::put_event(ros::Time time, const std::string& json) {
  last_event_ = next_time(time, last_event_);
  put(topics::kEvents, last_event_, ros::String{json});
}

template <class Message>
void RunBag::put(const char* topic, ros::Time time, const Message& message, bool latching) {
  if (fault_) return;
  auto connection = connections_.find(topic);
  if (connection == connections_.end()) {
    const std::uint32_t id = writer_.add_connection(topic, ros::type_of<Message>(), latching);
    connection = connections_.emplace(topic, id).first;
  }
  bytes_.clear();
  ros::serialise(message, bytes_);
  last_time_ = std::max(last_time_, time);
  ++message_count_;
  note(writer_.write(connection->second, time, bytes_));
}

void RunBag::flush() {
  if (!fault_) note(writer_.flush());
}

void RunBag::close(const Dropped& dropped) {
  put_event(last_time_, text_of({{"event", "recorded"},
                                 {"dropped",
                                  {{"depth_images", dropped.of(RecordClass::kDepth)},
                                   {"maps", dropped.of(RecordClass::kMap)},
                                   {"states", dropped.of(RecordClass::kState)}}}}));
  // Where the disk is full, the index of what is there may still find room.
  const auto closed = writer_.close();
  if (!fault_) note(closed);
}

void RunBag::note(const Result<void>& done) {
  if (!done) fault_ = done.error();
}

}  // namespace sidestep
