#include <algorithm>
#include <cmath>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/experiments/experiments.hpp>

#include "bag_reader.hpp"
#include "command_line.hpp"
#include "inputs.hpp"
#include "run_recorder.hpp"
#include "support/host_fixture.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using Json = nlohmann::json;

const fs::path kConfigs = fs::path(SIDESTEP_SOURCE_DIR) / "tests/integration/configs";

/// Keeps all that it is told, and tells a recorder.
struct Relay final : RunObserver {
  explicit Relay(RunRecorder& to) : recorder(to) {}
  void begin(const ObservedWorld& world) override {
    worlds.push_back(world);
    maps.emplace_back();
    steps.emplace_back();
    events.emplace_back();
    recorder.begin(world);
  }
  void mapped(const ObservedMap& map) override {
    maps.back().push_back(map);
    recorder.mapped(map);
  }
  void stepped(const ObservedStep& step) override {
    steps.back().push_back(step);
    recorder.stepped(step);
  }
  void happened(const ObservedEvent& event) override {
    events.back().push_back(event);
    recorder.happened(event);
  }
  void end(const ObservedEnd& end) override { recorder.end(end); }

  RunRecorder& recorder;
  std::vector<ObservedWorld> worlds;
  std::vector<std::vector<ObservedMap>> maps;  ///< By episode, as the next two.
  std::vector<std::vector<ObservedStep>> steps;
  std::vector<std::vector<ObservedEvent>> events;
};

/// A short closed loop of two episodes in lockstep, what was told of it, and what its bag holds.
class RecordTest : public ::testing::Test {
 protected:
  void record(const std::string& config) {
    testing_support::HostFixture fixture({PLUGIN_FOLDER});
    const auto reading = read_configuration(kConfigs / config, {}, fixture.documents);
    ASSERT_TRUE(reading.errors.empty());
    auto recorder = RunRecorder::start(folder_.path() / "run.bag", fixture.log);
    ASSERT_TRUE(recorder) << recorder.error().describe();
    relay_.emplace(**recorder);
    ExperimentContext context{reading.configuration, fixture.host,   fixture.log,
                              fixture.documents,     folder_.path(), 7};
    context.observer = &*relay_;
    const auto outcome = run_experiment(context);
    ASSERT_TRUE(outcome) << outcome.error().describe();
    (*recorder)->finish();
    read_bag();
  }
  void read_bag() {
    auto reader = bag::Reader::open(folder_.path() / "run.bag");
    ASSERT_TRUE(reader) << reader.error().describe();
    EXPECT_TRUE(reader->is_indexed());
    for (auto message = reader->next(); message && *message; message = reader->next()) {
      const auto data = (*message)->data;
      bytes_[(*message)->connection->topic].emplace_back(data.begin(), data.end());
    }
    for (const auto& text : all<ros::String>(topics::kEvents)) {
      const Json event = Json::parse(text.data);
      if (event["event"] == "begin") epochs_.push_back(Stamp::from_seconds(event["epoch_s"]));
    }
  }
  template <class Message>
  [[nodiscard]] std::vector<Message> all(const std::string& topic) {
    std::vector<Message> all;
    for (const auto& bytes : bytes_[topic]) {
      auto message = ros::parse<Message>(bytes);
      EXPECT_TRUE(message);
      if (message) all.push_back(std::move(*message));
    }
    return all;
  }
  template <class Of, class Visit>
  void for_each_of(const std::vector<std::vector<Of>>& episodes, const Visit& visit) const {
    ASSERT_EQ(episodes.size(), epochs_.size());
    for (std::size_t e = 0; e < episodes.size(); ++e) {
      for (const Of& one : episodes[e]) visit(one, epochs_[e]);
    }
  }

  testing_support::TemporaryFolder folder_;
  std::optional<Relay> relay_;
  std::map<std::string, std::vector<std::vector<std::byte>>> bytes_;
  std::vector<Stamp> epochs_;  ///< By episode.
};

/// Every pixel in m, NaN where nothing was measured.
std::vector<float> depths_of(const ros::Image& image) {
  std::vector<float> all_m(std::size_t{image.width} * image.height);
  const bool is_mm = image.encoding == "16UC1";
  EXPECT_EQ(image.data.size(), all_m.size() * (is_mm ? 2 : 4));
  for (std::size_t i = 0; i < all_m.size(); ++i) {
    std::uint16_t mm = 0;
    if (is_mm) {
      std::memcpy(&mm, image.data.data() + 2 * i, 2);
      all_m[i] = mm == 0 ? std::nanf("") : static_cast<float>(mm) / 1000.0F;
    } else {
      std::memcpy(&all_m[i], image.data.data() + 4 * i, 4);
    }
  }
  return all_m;
}

TEST_F(RecordTest, DepthImagesAreTheFrames) {
  ASSERT_NO_FATAL_FAILURE(record("tiny_replan.yaml"));
  const auto images = all<ros::Image>(topics::kDepth);
  const auto infos = all<ros::CameraInfo>(topics::kCameraInfo);
  ASSERT_EQ(images.size(), relay_->maps[0].size() + relay_->maps[1].size());
  ASSERT_EQ(infos.size(), images.size());
  std::size_t next = 0;
  for_each_of(relay_->maps, [&](const ObservedMap& map, Stamp epoch) {
    const ros::Image& image = images[next];
    EXPECT_EQ(run_stamp(image.header.stamp, epoch), map.frame->stamp);
    EXPECT_EQ(infos[next++].header.stamp, image.header.stamp);
    const auto& depth = std::get<DepthImage>(map.frame->measurement);
    const std::vector<float> all_m = depths_of(image);
    ASSERT_EQ(all_m.size(), depth.depth_m.size());
    for (std::size_t i = 0; i < all_m.size(); ++i) {
      const float expected_m = depth.depth_m[i];
      if (expected_m > 0.0F) {
        ASSERT_EQ(all_m[i], expected_m);
      } else {
        ASSERT_TRUE(std::isnan(all_m[i]));
      }
    }
  });
}

TEST_F(RecordTest, PosesAreThoseOfTheJointsAtTheSameTime) {
  ASSERT_NO_FATAL_FAILURE(record("tiny_replan.yaml"));
  std::map<ros::Time, std::vector<double>> q_at;
  for (const auto& state : all<ros::JointState>(topics::kJointStates)) {
    q_at[state.header.stamp] = state.position;
  }
  std::size_t steps = 0;
  for_each_of(relay_->steps, [&](const ObservedStep& step, Stamp epoch) {
    ++steps;
    const auto found = q_at.find(ros_time(step.stamp, epoch));
    ASSERT_NE(found, q_at.end());
    EXPECT_EQ(found->second, std::vector<double>(step.q.begin(), step.q.end()));
  });
  EXPECT_GE(q_at.size(), steps);

  const RobotModel& robot = *relay_->worlds[0].robot;
  const auto& links = robot.description().links;
  std::vector<Transform> T_world_link(links.size());
  Scratch scratch;
  std::size_t compared = 0;
  for (const auto& message : all<ros::TFMessage>(topics::kTransforms)) {
    if (message.transforms.at(0).child_frame_id == "camera_optical_frame") continue;
    robot.link_poses(q_at.at(message.transforms[0].header.stamp), T_world_link, scratch);
    std::map<std::string, Transform> T_world{{"world", Transform::Identity()}};
    for (const ros::TransformStamped& one : message.transforms) {
      const auto& [t, r] = one.transform;
      Transform T_parent_link(Eigen::Translation3d(t.x, t.y, t.z));
      T_parent_link.rotate(Eigen::Quaterniond(r.w, r.x, r.y, r.z));
      T_world[one.child_frame_id] = T_world.at(one.header.frame_id) * T_parent_link;
    }
    for (std::size_t i = 0; i < links.size(); ++i) {
      EXPECT_TRUE(T_world.at(links[i].name).isApprox(T_world_link[i], 1e-12)) << links[i].name;
      ++compared;
    }
  }
  EXPECT_GE(compared, links.size() * steps / 6) << "50 Hz";
}

TEST_F(RecordTest, TrajectoriesAreThoseThatWereFollowed) {
  ASSERT_NO_FATAL_FAILURE(record("tiny_replan.yaml"));
  const auto trajectories = all<ros::JointTrajectory>(topics::kTrajectory);
  std::size_t next = 0;
  for_each_of(relay_->events, [&](const ObservedEvent& event, Stamp epoch) {
    if (event.followed == nullptr) return;
    ASSERT_LT(next, trajectories.size());
    const ros::JointTrajectory& recorded = trajectories[next++];
    EXPECT_EQ(recorded.header.stamp, ros_time(event.followed_start, epoch));
    EXPECT_EQ(recorded.joint_names, (std::vector<std::string>{"x", "y"}));
    ASSERT_EQ(static_cast<int>(recorded.points.size()), event.followed->size());
    for (int i = 0; i < event.followed->size(); ++i) {
      const auto& point = recorded.points[static_cast<std::size_t>(i)];
      EXPECT_TRUE(std::ranges::equal(point.positions, event.followed->q(i)));
      EXPECT_TRUE(std::ranges::equal(point.velocities, event.followed->qdot(i)));
    }
  });
  EXPECT_EQ(next, trajectories.size());
  EXPECT_GE(next, 2U);
}

TEST_F(RecordTest, TheLastCubesAreTheVoxelsThatTheLastFieldHasAsOccupied) {
  ASSERT_NO_FATAL_FAILURE(record("tiny_replan.yaml"));
  const DistanceField& field = *relay_->maps[1].back().snapshot.field;
  const GridSpec& grid = field.info().grid;
  std::size_t occupied = 0;
  for (int k = 0; k < grid.size_vox.z(); ++k) {
    for (int j = 0; j < grid.size_vox.y(); ++j) {
      for (int i = 0; i < grid.size_vox.x(); ++i) {
        const Eigen::Vector3d centre_m = grid.centre_m({i, j, k});
        double distance_m = 0.0;
        FieldStatus status{};
        field.query(std::span(&centre_m, 1), std::span(&distance_m, 1), {}, std::span(&status, 1));
        occupied += distance_m <= 0.0 && status == FieldStatus::kKnown ? 1 : 0;
      }
    }
  }
  ASSERT_GT(occupied, 100U);
  const auto maps = all<ros::MarkerArray>(topics::kMap);
  EXPECT_EQ(maps.back().markers.at(1).points.size(), occupied);
}

TEST_F(RecordTest, ItsMotionsAndItsMapCanBeCertified) {
  ASSERT_NO_FATAL_FAILURE(record("tiny_replan.yaml"));
  const RobotDescription& robot = relay_->worlds[0].robot->description();
  const auto motions = read_motions(folder_.path() / "run.bag", robot, {});
  ASSERT_TRUE(motions) << motions.error().describe();
  std::size_t next = 0;
  for_each_of(relay_->events, [&](const ObservedEvent& event, Stamp) {
    if (event.followed == nullptr || event.followed->size() < 2) return;
    ASSERT_LT(next, motions->size());
    const PolynomialMotion& motion = (*motions)[next++].motion;
    EXPECT_EQ(motion.joining, Joining::kCubic);
    EXPECT_NEAR(motion.duration_s(), event.followed->times_s.back(), 2e-9);
    EXPECT_NEAR(motion.pieces[0].coefficients[1][1], event.followed->qdot(0)[1], 1e-12);
  });
  EXPECT_EQ(next, motions->size());
  const auto map = read_certified_scene(folder_.path() / "run.bag", robot, {});
  ASSERT_TRUE(map) << map.error().describe();
  EXPECT_EQ(map->apart_from.swarms.at(0).members.size(),
            all<ros::MarkerArray>(topics::kMap).back().markers.at(1).points.size());
  EXPECT_THAT(
      read_certified_scene(folder_.write("cut.bag", "#ROSBAG"), robot, {}).error().describe(),
      HasSubstr("cut.bag"));
}

TEST_F(RecordTest, APlanExperimentHasItsMapAndItsPlans) {
  ASSERT_NO_FATAL_FAILURE(record("tiny.yaml"));
  EXPECT_EQ(all<ros::Image>(topics::kDepth).size(), relay_->maps[0].size());
  const auto followed =
      std::ranges::count_if(relay_->events[0], [](const auto& e) { return e.followed != nullptr; });
  EXPECT_GE(followed, 1);
  EXPECT_EQ(static_cast<std::ptrdiff_t>(all<ros::JointTrajectory>(topics::kTrajectory).size()),
            followed);
  EXPECT_FALSE(all<ros::TFMessage>(topics::kTransforms).empty());
}

class RecordCommand : public ::testing::Test {
 protected:
  [[nodiscard]] Finished record(const fs::path& file, const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = {"run",      (kConfigs / "tiny_replan.yaml").string(),
                                          "--record", file.string(),
                                          "--set",    "experiment.episodes=1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  [[nodiscard]] std::string in_folder(const std::string& name) const {
    return (folder_.path() / name).string();
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(RecordCommand, LeavesAFileThatExistsAloneAndDoesNotRun) {
  const fs::path file = folder_.write("mine.bag", "precious");
  const Finished finished = record(file, {"--out", in_folder("run")});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_THAT(finished.error, HasSubstr("--record " + file.string() + ": the file exists"));
  EXPECT_EQ(read_file(file), "precious");
  EXPECT_FALSE(fs::exists(folder_.path() / "run"));
}

TEST_F(RecordCommand, SaysWhyAFileCannotBeMade) {
  const Finished finished = record(in_folder("none/run.bag"), {"--out", in_folder("run")});
  EXPECT_EQ(finished.exit_code, 4);
  EXPECT_THAT(finished.error, HasSubstr("none/run.bag"));
  EXPECT_THAT(finished.error, HasSubstr("No such file or directory"));
}

TEST_F(RecordCommand, RefusesSeveralRunsInOneRecording) {
  const Finished two = run({"run", (kConfigs / "tiny_replan.yaml").string(),
                            (kConfigs / "tiny.yaml").string(), "--record", in_folder("run.bag")});
  EXPECT_EQ(two.exit_code, 2);
  EXPECT_THAT(two.error, HasSubstr("a recording holds the run of one configuration"));
  const Finished jobs = record(in_folder("run.bag"), {"--jobs", "2"});
  EXPECT_EQ(jobs.exit_code, 2);
  EXPECT_THAT(jobs.error, HasSubstr("--jobs"));
  EXPECT_FALSE(fs::exists(folder_.path() / "run.bag"));
}

TEST_F(RecordCommand, ChangesNothingOfTheRun) {
  ASSERT_EQ(record(in_folder("run.bag"), {"--out", in_folder("recorded")}).exit_code, 0);
  ASSERT_EQ(run({"run", (kConfigs / "tiny_replan.yaml").string(), "--set", "experiment.episodes=1",
                 "--out", in_folder("alone")})
                .exit_code,
            0);
  const auto summary = [&](const std::string& name) {
    Json json = Json::parse(read_file(folder_.path() / name / "summary.json"));
    json.erase("solve_ms");
    json.erase("search_ms");
    return json;
  };
  EXPECT_EQ(summary("recorded"), summary("alone"));
  const auto reader = bag::Reader::open(in_folder("run.bag"));
  ASSERT_TRUE(reader) << reader.error().describe();
  EXPECT_TRUE(reader->is_indexed());
}

}  // namespace
}  // namespace sidestep::testing
