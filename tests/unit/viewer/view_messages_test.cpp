#include "view_messages.hpp"

#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "view_testing.hpp"

namespace sidestep {
namespace {

using ::testing::ElementsAre;
using testing_support::ChainRobot;
using testing_support::DecodedMessage;
using Json = nlohmann::json;

/// Base on rails, arm that turns; spheres on base and hand.
std::shared_ptr<const ChainRobot> rail_robot() {
  RobotDescription robot;
  robot.name = "rail";
  robot.joints = {{"x", Joint::Type::kPrismatic, -1.0, 2.0, 0.5, 1.0},
                  {"turn", Joint::Type::kContinuous, -std::numeric_limits<double>::infinity(),
                   std::numeric_limits<double>::infinity(), 1.5, 1.0}};
  robot.links = {{"world", -1}, {"base", 0}, {"hand", 1}, {"finger", 2}};
  robot.spheres = {{2, {0.1, 0.0, 0.0}, 0.05}, {1, {0.0, 0.0, 0.2}, 0.3}};
  robot.shapes = {{1, Box{{1.0, 2.0, 3.0}}, Transform::Identity()},
                  {2, Capsule{0.1, 0.4}, Transform(Eigen::Translation3d(0.0, 0.0, 0.5))}};
  return std::make_shared<const ChainRobot>(
      robot, std::vector<ChainRobot::Step>{{},
                                           {{0.0, 0.0, 0.1}, Eigen::Vector3d::UnitX(), 0},
                                           {{1.0, 0.0, 0.0}, Eigen::Vector3d::UnitZ(), 1},
                                           {{0.5, 0.0, 0.0}, Eigen::Vector3d::UnitZ(), -1}});
}

TEST(WorldMessage, SaysWhatRobotAndSceneConsistOf) {
  auto mesh = std::make_shared<Mesh>();
  mesh->vertices_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh->triangles = {{0, 1, 2}};
  ObservedWorld world = testing_support::ball_world();
  std::vector<SceneObject> objects = world.scene->objects();
  const std::vector<Waypoint> still = {{0.0, Transform::Identity()}};
  objects.push_back({"pole", Cylinder{0.1, 2.0}, still, false, std::nullopt});
  objects.push_back({"ball", Sphere{0.25}, still, false, std::nullopt});
  objects.push_back({"thing", std::shared_ptr<const Mesh>(mesh), still, false, std::nullopt});
  world.scene = std::make_shared<const Scene>(objects);
  world.robot = rail_robot();
  world.q_start = Eigen::Vector2d(0.5, std::numbers::pi / 2.0);
  world.q_goal = Eigen::Vector2d(0.0, 0.0);

  const Json header = DecodedMessage(*world_message(world).bytes).header;
  EXPECT_EQ(header.at("kind"), "world");
  EXPECT_EQ(header.at("title"), "test");
  EXPECT_EQ(header.at("episode"), 3);
  EXPECT_EQ(header.at("robot"), "rail");
  EXPECT_EQ(
      header.at("joints").at(0),
      (Json{{"name", "x"}, {"unit", "m"}, {"lower", -1.0}, {"upper", 2.0}, {"max_velocity", 0.5}}));
  EXPECT_TRUE(header.at("joints").at(1).at("lower").is_null());
  EXPECT_EQ(header.at("joints").at(1).at("unit"), "rad");
  EXPECT_EQ(header.at("links"), (Json{"world", "base", "hand", "finger"}));
  EXPECT_EQ(header.at("tool_link"), 2);
  EXPECT_EQ(header.at("shapes").at(0).at("shape"),
            (Json{{"type", "box"}, {"size_m", {1.0, 2.0, 3.0}}}));
  EXPECT_EQ(header.at("shapes").at(1),
            (Json{{"link", 2},
                  {"shape", {{"type", "capsule"}, {"radius_m", 0.1}, {"length_m", 0.4}}},
                  {"pose", {0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0}}}));
  EXPECT_EQ(header.at("spheres").at(0),
            (Json{{"link", 2}, {"centre_m", {0.1, 0.0, 0.0}}, {"radius_m", 0.05}}));
  EXPECT_EQ(header.at("objects").at(0).at("shape"), (Json{{"type", "half_space"}}));
  EXPECT_EQ(header.at("objects").at(1),
            (Json{{"name", "box"},
                  {"shape", {{"type", "box"}, {"size_m", {1.0, 1.0, 1.0}}}},
                  {"pose", {2.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}},
                  {"moves", true}}));
  EXPECT_EQ(header.at("objects").at(2).at("shape"),
            (Json{{"type", "cylinder"}, {"radius_m", 0.1}, {"length_m", 2.0}}));
  EXPECT_EQ(header.at("objects").at(3).at("shape"), (Json{{"type", "sphere"}, {"radius_m", 0.25}}));
  EXPECT_EQ(header.at("objects").at(4).at("shape"),
            (Json{{"type", "mesh"},
                  {"vertices", {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}}},
                  {"triangles", {{0, 1, 2}}}}));
  // The hand: 0.5 m along the rail, 1 m ahead, turned by a quarter.
  const Json& hand = header.at("start").at(2);
  const double half = std::sqrt(0.5);
  const double expected[] = {1.5, 0.0, 0.1, 0.0, 0.0, half, half};
  for (std::size_t i = 0; i < 7; ++i) EXPECT_NEAR(hand.at(i), expected[i], 1e-12);
  EXPECT_EQ(header.at("goal").size(), 4U);
}

TEST(WorldMessage, OfARecordingSaysSo) {
  const ViewMessage live = world_message(testing_support::ball_world());
  const ViewMessage recorded = recorded_world(live);
  Json header = DecodedMessage(*live.bytes).header;
  EXPECT_FALSE(header.contains("recorded"));
  header["recorded"] = true;
  EXPECT_EQ(DecodedMessage(*recorded.bytes).header, header);
  const ViewMessage broken{ViewKind::kWorld, {}, std::make_shared<const std::string>("\1\0\0\0{")};
  EXPECT_EQ(recorded_world(broken).bytes, broken.bytes);
}

TEST(StateMessage, HasPosesAndTheNearest) {
  ObservedStep step = testing_support::step_at(2.5);
  step.status = Replanner::Status::kReached;
  Transform turned = Transform::Identity();
  turned.translate(Eigen::Vector3d(1.0, -2.0, 3.0));
  turned.rotate(Eigen::AngleAxisd(std::numbers::pi / 2.0, Eigen::Vector3d::UnitX()));
  const std::vector<Transform> links = {Transform::Identity(), turned};
  const std::vector<Transform> objects = {turned};
  const DecodedMessage message(
      *state_message(step, links, objects, Clearance{0.125, "hand", "table", {1.0, 2.0, 3.0}})
           .bytes);
  EXPECT_EQ(message.kind(), "state");
  EXPECT_EQ(message.header.at("time_s"), 2.5);
  EXPECT_EQ(message.header.at("status"), "reached");
  EXPECT_EQ(message.header.at("q"), (Json{2.5, 0.0, 1.0}));
  EXPECT_TRUE(message.header.at("true_q").is_null());
  EXPECT_EQ(message.header.at("clearance"), (Json{{"distance_m", 0.125},
                                                  {"link", "hand"},
                                                  {"object", "table"},
                                                  {"point_m", {1.0, 2.0, 3.0}}}));
  ASSERT_EQ(message.payload.size(), 3U * 7U * 4U);
  const float half = std::sqrt(0.5F);
  const float expected[] = {1.0F, -2.0F, 3.0F, half, 0.0F, 0.0F, half};
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_NEAR(message.f32(7 + i), expected[i], 1e-6F);
    EXPECT_NEAR(message.f32(14 + i), expected[i], 1e-6F);
  }
  step.q_true = Eigen::Vector3d(1.0, 2.0, 3.0);
  step.q.resize(0);
  const DecodedMessage other(*state_message(step, links, {}, std::nullopt).bytes);
  EXPECT_EQ(other.header.at("true_q"), (Json{1.0, 2.0, 3.0}));
  EXPECT_EQ(other.header.at("q"), Json::array());
  EXPECT_TRUE(other.header.at("clearance").is_null());
}

TEST(FrameMessage, HasEveryNthPixelInMillimetres) {
  Frame frame;
  frame.stamp = Stamp::from_seconds(1.25);
  frame.T_world_camera.translation() = Eigen::Vector3d(1.0, 2.0, 3.0);
  DepthImage image;
  image.camera = {401, 7, 100.0, 101.0, 200.0, 3.0};
  for (int i = 0; i < 401 * 7; ++i) image.depth_m.push_back(0.001F * static_cast<float>(i + 1));
  image.depth_m[0] = std::numeric_limits<float>::quiet_NaN();
  image.depth_m[3] = 0.0F;
  image.depth_m[6] = 1000.0F;
  frame.measurement = image;
  const auto made = frame_message(Stamp::from_seconds(1.5), frame);
  ASSERT_TRUE(made);
  const DecodedMessage message(*made->bytes);
  EXPECT_EQ(message.kind(), "frame");
  EXPECT_EQ(message.header.at("stamp_s"), 1.25);
  EXPECT_EQ(message.header.at("time_s"), 1.5);
  EXPECT_EQ(message.header.at("pose"), (Json{1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0}));
  EXPECT_EQ(message.header.at("camera"), (Json{{"width_px", 401},
                                               {"height_px", 7},
                                               {"fx_px", 100.0},
                                               {"fy_px", 101.0},
                                               {"cx_px", 200.0},
                                               {"cy_px", 3.0}}));
  EXPECT_EQ(message.header.at("columns"), 134);  // every third of 401
  EXPECT_EQ(message.header.at("rows"), 3);
  ASSERT_EQ(message.payload.size(), 2U * 134U * 3U);
  EXPECT_EQ(message.u16(0), 0);
  EXPECT_EQ(message.u16(1), 0);
  EXPECT_EQ(message.u16(2), 65535);
  EXPECT_EQ(message.u16(3), 10);
  EXPECT_EQ(message.u16(134 + 5), 3 * 401 + 15 + 1);
  EXPECT_EQ(message.u16(2 * 134 + 133), 6 * 401 + 399 + 1);
}

TEST(FrameMessage, PointCloudsHaveNone) {
  Frame frame;
  frame.measurement = PointCloud{};
  EXPECT_FALSE(frame_message({}, frame));
}

TEST(PlanMessage, HasTheWaysOfToolAndBaseAndTheSweptPoses) {
  const auto robot = rail_robot();
  const RobotState from{Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d::Zero()};
  const RobotState to{Eigen::Vector2d(1.0, std::numbers::pi / 2.0), Eigen::Vector2d::Zero()};
  const Trajectory trajectory = straight_line(from, to, 11, 0.1);
  const DecodedMessage message(*plan_message(Stamp::from_seconds(3.0), "followed", trajectory,
                                             Stamp::from_seconds(3.5), *robot)
                                    .bytes);
  EXPECT_EQ(message.header.at("role"), "followed");
  EXPECT_EQ(message.header.at("start_s"), 3.5);
  const auto times_s = message.header.at("times_s").get<std::vector<double>>();
  const auto swept_s = message.header.at("swept_s").get<std::vector<double>>();
  ASSERT_EQ(times_s.size(), 21U);
  ASSERT_GE(swept_s.size(), 2U);
  EXPECT_EQ(times_s.front(), 0.0);
  EXPECT_NEAR(times_s.back(), 1.0, 1e-12);
  EXPECT_NEAR(swept_s.back(), 1.0, 1e-12);
  const std::size_t n = times_s.size();
  ASSERT_EQ(message.payload.size(), 4U * (6U * n + swept_s.size() * 4U * 7U));
  std::vector<double> q(2);
  for (std::size_t i = 0; i < n; ++i) {
    trajectory.sample(times_s[i], q, {});
    // The tool is the hand, whose turning does not move it.
    EXPECT_NEAR(message.f32(3 * i), q[0] + 1.0, 1e-6);
    EXPECT_NEAR(message.f32(3 * i + 2), 0.1, 1e-6);
    EXPECT_NEAR(message.f32(3 * (n + i)), q[0], 1e-6);
  }
  for (std::size_t i = 0; i < swept_s.size(); ++i) {
    trajectory.sample(swept_s[i], q, {});
    const std::size_t finger = 6 * n + 7 * (4 * i + 3);
    EXPECT_NEAR(message.f32(finger), q[0] + 1.0 + 0.5 * std::cos(q[1]), 1e-6);
    EXPECT_NEAR(message.f32(finger + 1), 0.5 * std::sin(q[1]), 1e-6);
    EXPECT_NEAR(message.f32(finger + 5), std::sin(0.5 * q[1]), 1e-6);
    EXPECT_NEAR(message.f32(finger + 6), std::cos(0.5 * q[1]), 1e-6);
  }
}

TEST(PlanMessage, LongMotionsHaveABoundedLength) {
  const auto robot = rail_robot();
  const DecodedMessage message(
      *plan_message({}, "refused", make_trajectory(2, 1000, 1.0), {}, *robot).bytes);
  EXPECT_EQ(message.header.at("times_s").size(), 400U);
  EXPECT_EQ(message.header.at("swept_s").size(), 24U);
  EXPECT_NEAR(message.header.at("times_s").at(399), 999.0, 1e-9);
}

TEST(PlanMessage, NothingToFollowIsEmpty) {
  const DecodedMessage message(*plan_message({}, "followed", {}, {}, *rail_robot()).bytes);
  EXPECT_TRUE(message.header.at("times_s").empty());
  EXPECT_TRUE(message.header.at("swept_s").empty());
  EXPECT_TRUE(message.payload.empty());
}

TEST(EventMessage, TellsAll) {
  ObservedEvent event = testing_support::plan_at(1.0);
  event.event.reason = ReplannerEvent::Reason::kBlocked;
  event.event.cause = "hand meets \xff table";  // no UTF-8
  event.event.solve_ms = 3.5;
  event.event.attempts = 2;
  event.event.cost = std::numeric_limits<double>::infinity();
  event.event.takeover = Stamp::from_seconds(1.1);
  event.event.map_stamp = Stamp::from_seconds(0.9);
  event.stamp_to_trajectory_ms = 12.5;
  const Json header = DecodedMessage(*event_message(event).bytes).header;
  EXPECT_EQ(header.at("kind"), "event");
  EXPECT_EQ(header.at("time_s"), 1.0);
  EXPECT_EQ(header.at("event"), to_string(ReplannerEvent::Kind::kPlanned));
  EXPECT_EQ(header.at("reason"), to_string(ReplannerEvent::Reason::kBlocked));
  EXPECT_EQ(header.at("cause"), "hand meets \xef\xbf\xbd table");
  EXPECT_EQ(header.at("solve_ms"), 3.5);
  EXPECT_EQ(header.at("guess"), "straight_line");
  EXPECT_EQ(header.at("tried"), (Json{"refit", "straight_line"}));
  EXPECT_EQ(header.at("attempts"), 2);
  EXPECT_TRUE(header.at("cost").is_null());
  EXPECT_EQ(header.at("takeover_s"), 1.1);
  EXPECT_EQ(header.at("map_stamp_s"), 0.9);
  EXPECT_EQ(header.at("stamp_to_trajectory_ms"), 12.5);
  event.stamp_to_trajectory_ms.reset();
  EXPECT_TRUE(
      DecodedMessage(*event_message(event).bytes).header.at("stamp_to_trajectory_ms").is_null());
}

TEST(TimingMessage, HasListsOfNumbers) {
  ViewTiming timing;
  timing.frames = {{1.0, 1.1, 1.2, 3.0, 4.0}, {2.0, 2.1, 2.2, 5.0, 6.0}};
  timing.steps = {{0.5, 0.25}};
  timing.checks = 12;
  timing.frames_dropped = 3;
  const Json header = DecodedMessage(*timing_message({}, timing).bytes).header;
  EXPECT_EQ(header.at("frames"), (Json{{1.0, 1.1, 1.2, 3.0, 4.0}, {2.0, 2.1, 2.2, 5.0, 6.0}}));
  EXPECT_EQ(header.at("steps"), Json::array({Json::array({0.5, 0.25})}));
  EXPECT_EQ(header.at("checks"), 12);
  EXPECT_EQ(header.at("frames_dropped"), 3);
}

TEST(TracksMessage, HasTracksAndPredictedSetsOnTheClockOfTheRun) {
  Tracks tracks;
  tracks.tracks.emplace_back();
  tracks.tracks[0].id = 4;
  tracks.tracks[0].position_m = {1.0, -2.0};
  tracks.tracks[0].velocity_mps = {0.5, 0.25};
  tracks.tracks[0].radius_m = 0.375;
  tracks.tracks[0].top_m = 1.75;
  PredictedSet set;
  set.track = 4;
  set.likelihood = 0.5;
  set.top_m = 1.75;
  set.knots = {{0.0, {1.0, -2.0}, 0.375}, {2.0, {2.0, -1.5}, 1.0}};
  const auto prediction = Prediction::create(Stamp::from_seconds(3.0), {set});
  ASSERT_TRUE(prediction);
  const DecodedMessage message(
      *tracks_message(Stamp::from_seconds(3.25), &tracks, &*prediction).bytes);
  EXPECT_EQ(message.header,
            (Json{{"kind", "tracks"},
                  {"time_s", 3.25},
                  {"tracks",
                   {{{"id", 4},
                     {"position_m", {1.0, -2.0}},
                     {"velocity_mps", {0.5, 0.25}},
                     {"radius_m", 0.375},
                     {"bottom_m", 0.0},
                     {"top_m", 1.75}}}},
                  {"sets",
                   {{{"track", 4},
                     {"likelihood", 0.5},
                     {"bottom_m", 0.0},
                     {"top_m", 1.75},
                     {"knots", {{3.0, 1.0, -2.0, 0.375}, {5.0, 2.0, -1.5, 1.0}}}}}}}));
  const DecodedMessage nothing(*tracks_message({}, nullptr, nullptr).bytes);
  EXPECT_EQ(nothing.header.at("tracks"), Json::array());
  EXPECT_EQ(nothing.header.at("sets"), Json::array());
}

TEST(ContactMessage, SaysWhoseContactItWas) {
  TrueContact contact{"base", "walker", 2.5, 2.75, 0.012, 0.25};
  const DecodedMessage own(*contact_message(contact).bytes);
  EXPECT_EQ(own.kind(), "event");
  EXPECT_EQ(own.header.at("time_s"), 2.5);
  EXPECT_EQ(own.header.at("event"), "contact_by_robot");
  EXPECT_EQ(own.header.at("cause"),
            "base and walker touched, 12 mm deep; the robot went towards it at 0.25 m/s");
  contact.approach_mps = -0.1;
  EXPECT_EQ(DecodedMessage(*contact_message(contact).bytes).header.at("event"),
            "contact_by_others");
}

TEST(EndMessage, HasTheVerdict) {
  const DecodedMessage message(
      *end_message({Stamp::from_seconds(9.0), true, "Success: reached"}).bytes);
  EXPECT_EQ(
      message.header,
      (Json{{"kind", "end"}, {"time_s", 9.0}, {"success", true}, {"verdict", "Success: reached"}}));
  EXPECT_TRUE(message.payload.empty());
}

TEST(PageMessage, OnlySlicesAreUnderstood) {
  const auto slice = read_page_message(R"({"slice": {"axis": "y", "position_m": -0.5}})");
  ASSERT_TRUE(slice);
  EXPECT_EQ(slice->slice, (SliceRequest{1, -0.5}));
  const auto later =
      read_page_message(R"({"slice": {"axis": "x", "position_m": 1, "ahead_s": 2.5}})");
  ASSERT_TRUE(later);
  EXPECT_EQ(later->slice, (SliceRequest{0, 1.0, 2.5}));
  const auto none = read_page_message(R"({"slice": null})");
  ASSERT_TRUE(none);
  EXPECT_FALSE(none->slice);
  for (const char* text :
       {"", "null", "{}", "[]", "{\"slice\"", R"({"slice": 1})", R"({"slice": {}})",
        R"({"slice": {"axis": "w", "position_m": 0}})",
        R"({"slice": {"axis": 2, "position_m": 0}})",
        R"({"slice": {"axis": "x", "position_m": "0"}})", R"({"slice": {"axis": "x"}})",
        R"({"slice": {"axis": "x", "position_m": 1e999}})",
        R"({"slice": {"axis": "x", "position_m": 0, "more": 1}})",
        R"({"slice": {"axis": "x", "position_m": 0, "ahead_s": "1"}})",
        R"({"slice": {"axis": "x", "position_m": 0, "ahead_s": 1e999}})",
        R"({"slice": {"axis": "x", "position_m": 0, "ahead_s": 1, "more": 1}})",
        R"({"slice": null, "stop": true})", R"({"stop": true})", "\xff\xfe"}) {
    EXPECT_FALSE(read_page_message(text)) << text;
  }
}

}  // namespace
}  // namespace sidestep
