#include <condition_variable>
#include <mutex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "bag_reader.hpp"
#include "conformance/test_host.hpp"
#include "file_limit.hpp"
#include "run_recorder.hpp"
#include "support/chain_robot.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Json = nlohmann::json;

/// A ball whose kinematics wait at a gate, or throw.
class GatedBall final : public RobotModel {
 public:
  [[nodiscard]] const RobotDescription& description() const noexcept override {
    return ball_->description();
  }
  void link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                  Scratch& scratch) const override {
    if (throws) throw std::runtime_error("the robot is out of order");
    std::unique_lock lock(mutex_);
    is_reached_ = true;
    changed_.notify_all();
    changed_.wait(lock, [&] { return is_open_; });
    ball_->link_poses(q, T_world_link, scratch);
  }
  void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                      Scratch& scratch) const override {
    ball_->sphere_centres(q, centres_m, scratch);
  }
  void sphere_jacobians(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const override {
    ball_->sphere_jacobians(q, centres_m, jacobians, scratch);
  }
  void pull_back(std::span<const double> q, std::span<const LinkForce> forces,
                 std::span<double> joint_forces, Scratch& scratch) const override {
    ball_->pull_back(q, forces, joint_forces, scratch);
  }

  void wait_until_reached() const {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return is_reached_; });
  }
  void open() {
    const std::lock_guard lock(mutex_);
    is_open_ = true;
    changed_.notify_all();
  }

  bool throws = false;

 private:
  std::shared_ptr<RobotModel> ball_ = testing_support::flying_ball(0.2);
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  mutable bool is_reached_ = false;
  bool is_open_ = false;
};

class RunRecorderTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<RunRecorder> start(
      std::size_t most_bytes = RunRecorder::kMostQueued_bytes) {
    auto recorder = RunRecorder::start(file_, log_, most_bytes);
    EXPECT_TRUE(recorder) << recorder.error().describe();
    return std::move(*recorder);
  }
  static ObservedWorld world(std::shared_ptr<const RobotModel> robot, std::int64_t episode = 0) {
    SceneObject walker{"walker", Sphere{0.3}, {{0.0, Transform::Identity()}}, false, {}};
    walker.waypoints.push_back({10.0, Transform(Eigen::Translation3d(1.0, 0.0, 0.0))});
    SceneObject box{"box", Box{{1.0, 1.0, 1.0}}, {{0.0, Transform::Identity()}}, false, {}};
    return {"title",
            episode,
            std::move(robot),
            std::make_shared<const Scene>(std::vector{walker, box}),
            Eigen::Vector3d(1, 2, 3),
            Eigen::Vector3d(4, 5, 6)};
  }
  static ObservedMap map(int number, int side_px = 8) {
    DepthImage depth{{side_px, side_px, 10.0, 10.0, 3.5, 3.5}, {}};
    for (int i = 0; i < side_px * side_px; ++i) {
      depth.depth_m.push_back(static_cast<float>(number + i % 500) / 1000.0F);
    }
    auto frame = std::make_shared<Frame>();
    frame->sequence = number;
    frame->stamp = Stamp::from_seconds(0.1 * number);
    frame->T_world_camera.translate(Eigen::Vector3d(0.0, 0.0, 0.01 * number));
    frame->measurement = std::move(depth);
    ObservedMap map;
    map.frame = std::move(frame);
    map.received = Stamp::from_seconds(0.1 * number + 0.03);
    map.published = Stamp::from_seconds(0.1 * number + 0.05);
    const FieldInfo info{.grid = {{0.0, 0.0, 0.0}, 0.1, {16, 16, 16}}};
    map.snapshot.field = make_dense_field(info, [&](const Eigen::Vector3i& voxel) {
      return voxel.x() == number % 16 && voxel.y() == 0 && voxel.z() == 0 ? 0.0 : 0.1;
    });
    return map;
  }
  static ObservedStep step(double time_s) {
    ObservedStep step;
    step.stamp = Stamp::from_seconds(time_s);
    step.q = Eigen::Vector3d(time_s, 0.0, 0.0);
    return step;
  }
  static ObservedEvent event(double time_s, const std::string& cause, bool is_plan = false) {
    ObservedEvent event;
    event.event.stamp = Stamp::from_seconds(time_s);
    event.event.cause = cause;
    if (is_plan) {
      event.followed = std::make_shared<const Trajectory>(make_trajectory(3, 4, 0.5));
      event.followed_start = Stamp::from_seconds(time_s - 0.2);
    }
    return event;
  }

  struct Read {
    ros::Time time;
    std::vector<std::byte> data;
  };
  /// What the bag holds, by topic.
  void read_bag() {
    auto reader = bag::Reader::open(file_);
    ASSERT_TRUE(reader) << reader.error().describe();
    EXPECT_TRUE(reader->is_indexed());
    for (;;) {
      const auto message = reader->next();
      ASSERT_TRUE(message) << message.error().describe();
      if (!*message) break;
      const auto data = (*message)->data;
      read_[(*message)->connection->topic].push_back(
          {(*message)->time, {data.begin(), data.end()}});
    }
  }
  template <class Message>
  [[nodiscard]] std::vector<Message> all(const std::string& topic) {
    std::vector<Message> all;
    for (const Read& read : read_[topic]) {
      auto message = ros::parse<Message>(read.data);
      EXPECT_TRUE(message);
      if (message) all.push_back(std::move(*message));
    }
    return all;
  }
  [[nodiscard]] std::vector<Json> events() {
    std::vector<Json> events;
    for (const ros::String& text : all<ros::String>(topics::kEvents)) {
      events.push_back(Json::parse(text.data, nullptr, false));
    }
    return events;
  }
  [[nodiscard]] static std::vector<std::string> values_of(const std::vector<Json>& events,
                                                          const std::string& key) {
    std::vector<std::string> values;
    for (const Json& event : events) {
      if (event.contains(key)) values.push_back(event[key].get<std::string>());
    }
    return values;
  }

  testing_support::TemporaryFolder folder_;
  fs::path file_ = folder_.path() / "run.bag";
  conformance::RecordingLog log_;
  std::map<std::string, std::vector<Read>> read_;
};

TEST_F(RunRecorderTest, RecordsWhatItIsTold) {
  const auto ball = testing_support::flying_ball(0.2);
  const auto recorder = start();
  recorder->begin(world(ball));
  recorder->mapped(map(0));
  recorder->happened(event(0.0, "the goal", true));
  for (int i = 0; i <= 100; ++i) recorder->stepped(step(0.01 * i));
  recorder->mapped(map(7));
  recorder->end({Stamp::from_seconds(1.0), true, "there"});
  recorder->finish();
  read_bag();

  EXPECT_THAT(values_of(events(), "event"), ElementsAre("begin", "planned", "end", "recorded"));
  const Json begin = events()[0];
  EXPECT_EQ(begin["title"], "title");
  EXPECT_EQ(begin["epoch_s"], 1.0);
  EXPECT_EQ(begin["q_goal"], Json::array({4.0, 5.0, 6.0}));
  EXPECT_EQ(events()[1]["cause"], "the goal");
  EXPECT_EQ(events()[2]["verdict"], "there");
  EXPECT_EQ(events()[3]["dropped"]["depth_images"], 0);

  const auto images = all<ros::Image>(topics::kDepth);
  ASSERT_EQ(images.size(), 2U);
  EXPECT_EQ(images[1].header.stamp, (ros::Time{1, 700'000'000}));
  EXPECT_EQ(read_[topics::kDepth][1].time, (ros::Time{1, 730'000'000})) << "when it was received";
  EXPECT_EQ(all<ros::CameraInfo>(topics::kCameraInfo).size(), 2U);

  // Every step, and once before the first one.
  const auto states = all<ros::JointState>(topics::kJointStates);
  ASSERT_EQ(states.size(), 102U);
  EXPECT_EQ(states[0].position, (std::vector<double>{1.0, 2.0, 3.0}));
  EXPECT_DOUBLE_EQ(states[101].position[0], 1.0);
  EXPECT_EQ(states[101].header.stamp, (ros::Time{2, 0}));

  std::size_t of_camera = 0, of_robot = 0;
  for (const ros::TFMessage& message : all<ros::TFMessage>(topics::kTransforms)) {
    (message.transforms[0].child_frame_id == "camera_optical_frame" ? of_camera : of_robot) += 1;
  }
  EXPECT_EQ(of_camera, 2U);
  EXPECT_EQ(of_robot, 51U) << "50 Hz";
  // 10 Hz, with the walker where it is.
  const auto moving = all<ros::MarkerArray>(topics::kMoving);
  ASSERT_EQ(moving.size(), 11U);
  EXPECT_NEAR(moving[10].markers[1].pose.position.x, 0.1, 1e-9);
  EXPECT_EQ(all<ros::MarkerArray>(topics::kScene).size(), 1U);
  EXPECT_EQ(all<ros::MarkerArray>(topics::kRobot).size(), 1U);
  const auto maps = all<ros::MarkerArray>(topics::kMap);
  ASSERT_EQ(maps.size(), 2U);
  EXPECT_NEAR(maps[1].markers[1].points.at(0).x, 0.75, 1e-9);
  const auto trajectories = all<ros::JointTrajectory>(topics::kTrajectory);
  ASSERT_EQ(trajectories.size(), 1U);
  EXPECT_EQ(trajectories[0].header.stamp, (ros::Time{0, 800'000'000}));
  EXPECT_EQ(trajectories[0].points.size(), 4U);
  EXPECT_EQ(all<ros::MarkerArray>(topics::kPaths).size(), 1U);
  EXPECT_EQ(log_.count(LogLevel::kWarning) + log_.count(LogLevel::kError), 0);
}

TEST_F(RunRecorderTest, MapsComeTwiceASecondAndTheLastOneAlways) {
  const auto recorder = start();
  recorder->begin(world(testing_support::flying_ball(0.2)));
  for (int i = 0; i < 14; ++i) recorder->mapped(map(i));
  recorder->end({Stamp::from_seconds(2.0), true, ""});
  recorder->finish();
  read_bag();
  std::vector<double> first_x_m;
  for (const ros::MarkerArray& array : all<ros::MarkerArray>(topics::kMap)) {
    first_x_m.push_back(array.markers.at(1).points.at(0).x);
  }
  using ::testing::DoubleNear;
  EXPECT_THAT(first_x_m, ElementsAre(DoubleNear(0.05, 1e-9), DoubleNear(0.55, 1e-9),
                                     DoubleNear(1.05, 1e-9), DoubleNear(1.35, 1e-9)));
}

TEST_F(RunRecorderTest, TheTimesOfEpisodesFollowOneAnother) {
  const auto ball = testing_support::flying_ball(0.2);
  const auto recorder = start();
  for (const std::int64_t episode : {0, 1, 2}) {
    recorder->begin(world(ball, episode));
    recorder->stepped(step(0.0));
    recorder->happened(event(3.25, "episode " + std::to_string(episode)));
    if (episode != 1) recorder->end({Stamp::from_seconds(3.5), true, ""});
  }
  recorder->finish();
  read_bag();
  std::vector<double> epochs_s;
  for (const Json& event : events()) {
    if (event["event"] == "begin") epochs_s.push_back(event["epoch_s"]);
  }
  // The first ends at 4.5 s, the second, which nobody ended, at 9.25 s.
  EXPECT_THAT(epochs_s, ElementsAre(1.0, 6.0, 11.0));
  const auto states = all<ros::JointState>(topics::kJointStates);
  ASSERT_EQ(states.size(), 3U);
  EXPECT_EQ(states[1].header.stamp, (ros::Time{6, 0}));
  EXPECT_EQ(states[2].header.stamp, (ros::Time{11, 0}));
}

TEST_F(RunRecorderTest, GivesUpTheOldestDepthImagesAndNeverHoldsUpTheRun) {
  const auto ball = std::make_shared<GatedBall>();
  constexpr int kFrames = 60, kSide_px = 32;
  constexpr std::size_t kFrame_bytes = sizeof(Frame) + kSide_px * kSide_px * sizeof(float);
  const auto recorder = start(30 * kFrame_bytes);
  recorder->begin(world(ball));
  recorder->stepped(step(0.0));
  ball->wait_until_reached();
  // From here on nothing is written: calls that waited for that would wait for ever.
  for (int i = 0; i < kFrames; ++i) {
    recorder->mapped(map(i, kSide_px));
    recorder->happened(event(0.1 * i, std::to_string(i)));
  }
  recorder->end({Stamp::from_seconds(10.0), true, "there"});
  ball->open();
  recorder->finish();
  read_bag();

  const std::vector<Json> told = events();
  std::vector<std::string> causes;
  for (int i = 0; i < kFrames; ++i) causes.push_back(std::to_string(i));
  EXPECT_EQ(values_of(told, "cause"), causes) << "an event is missing";
  const auto images = all<ros::Image>(topics::kDepth);
  EXPECT_LT(images.size(), 30U);
  EXPECT_GT(images.size(), 10U);
  // The newest ones, without a gap.
  for (std::size_t i = 0; i < images.size(); ++i) {
    const Stamp stamp = run_stamp(images[images.size() - 1 - i].header.stamp);
    EXPECT_EQ(stamp, Stamp::from_seconds(0.1 * (kFrames - 1 - static_cast<int>(i))));
  }
  const auto dropped = kFrames - static_cast<int>(images.size());
  EXPECT_EQ(told.back()["event"], "recorded");
  EXPECT_EQ(told.back()["dropped"]["depth_images"], dropped);
  ASSERT_FALSE(log_.messages().empty());
  EXPECT_THAT(log_.messages().back(),
              HasSubstr("lacks " + std::to_string(dropped) + " depth images"));
}

TEST_F(RunRecorderTest, WhereTheDiskIsFullTellsSoOnceAndTheRunGoesOn) {
  const auto ball = testing_support::flying_ball(0.2);
  constexpr std::size_t kLimit_bytes = 1'500'000;
  {
    const FileLimit limit(kLimit_bytes);
    const auto recorder = start();
    recorder->begin(world(ball));
    for (int i = 0; i < 100; ++i) recorder->mapped(map(i, 200));  // 80 kB each
    recorder->end({Stamp::from_seconds(10.0), true, ""});
    recorder->finish();
  }
  EXPECT_EQ(log_.count(LogLevel::kError), 1);
  ASSERT_FALSE(log_.messages().empty());
  EXPECT_THAT(log_.messages()[0], HasSubstr(file_.string()));
  EXPECT_THAT(log_.messages()[0], HasSubstr("File too large"));
  EXPECT_LE(fs::file_size(file_), kLimit_bytes);
  read_bag();
  EXPECT_GE(read_[topics::kDepth].size(), 8U) << "what had been written is lost";
}

TEST_F(RunRecorderTest, ARobotThatThrowsCostsItsPosesOnly) {
  const auto ball = std::make_shared<GatedBall>();
  ball->throws = true;
  const auto recorder = start();
  recorder->begin(world(ball));
  recorder->stepped(step(0.0));
  recorder->happened(event(1.0, "after it"));
  recorder->finish();
  read_bag();
  EXPECT_EQ(log_.count(LogLevel::kWarning), 2) << "the poses, and what a page would be shown";
  EXPECT_THAT(values_of(events(), "cause"), ElementsAre("after it"));
  EXPECT_EQ(read_[topics::kJointStates].size(), 1U);
}

TEST_F(RunRecorderTest, ClockThatIsTheWorldsGivesNoGapOfYears) {
  // Frames of a data set have the time of day; nothing of the recording is decades earlier.
  ObservedMap of_the_day = map(0);
  auto frame = std::make_shared<Frame>(*of_the_day.frame);
  frame->stamp = Stamp{1'305'031'102'000'000'000};
  of_the_day.frame = frame;
  of_the_day.received = of_the_day.published = frame->stamp;
  const auto recorder = start();
  recorder->begin(world(testing_support::flying_ball(0.2)));
  recorder->mapped(of_the_day);
  recorder->finish();
  read_bag();
  for (const auto& [topic, messages] : read_) {
    for (const Read& read : messages) EXPECT_EQ(read.time.sec, 1'305'031'103U) << topic;
  }
}

}  // namespace
}  // namespace sidestep::testing
