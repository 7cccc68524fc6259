#include <sidestep/runtime/planning_settings.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

RobotDescription small_robot() {
  RobotDescription robot;
  robot.name = "small";
  robot.joints = {{"base_x", Joint::Type::kPrismatic, -2.0, 2.0, 1.0, 1.0},
                  {"shoulder", Joint::Type::kRevolute, -1.5, 1.5, 1.0, 1.0},
                  {"elbow", Joint::Type::kRevolute, 0.0, 2.5, 1.0, 1.0}};
  robot.poses = {{"home", {std::nullopt, 0.5, 1.0}}, {"bent", {0.0, 9.0, 1.0}}};
  return robot;
}

struct Reading {
  Eigen::VectorXd q;
  std::vector<std::string> errors;  // where: message (hint)
};

Node parse(const std::string& text) {
  std::vector<Error> errors;
  const auto node = parse_yaml(text, "c.yaml", errors);
  EXPECT_TRUE(node && errors.empty()) << text;
  return node.value_or(Node());
}

Reading read(const std::string& text) {
  std::vector<Error> errors;
  Reading reading;
  reading.q = read_robot_state(parse(text), small_robot(), errors);
  for (const Error& error : errors) {
    EXPECT_EQ(error.code, ErrorCode::kConfig);
    reading.errors.push_back(error.describe());
  }
  return reading;
}

TEST(RobotState, JoinsAPoseAndJoints) {
  const Reading reading = read("{pose: home, joints: {base_x: -0.4, elbow: 0.25}}");
  EXPECT_THAT(reading.errors, ElementsAre());
  EXPECT_EQ(reading.q, Eigen::Vector3d(-0.4, 0.5, 0.25));
}

TEST(AllowedContacts, NameLinksOfTheRobotAndObjectsOfTheScene) {
  RobotDescription robot = small_robot();
  robot.links = {{"foot", -1}, {"arm", 0}};
  const Scene scene({{"floor", HalfSpace{}, {Waypoint{}}}, {"table", Sphere{0.1}, {Waypoint{}}}});
  const Node check = parse(
      "allowed_contacts:\n- {link: foot, object: floor}\n- {link: fot, object: tabel}\n"
      "- {link: [foot]}\n");
  const auto complaints = [&](const Scene* known) {
    std::vector<Error> errors;
    check_allowed_contacts(check, robot, known, errors);
    std::vector<std::string> texts;
    for (const Error& error : errors) texts.push_back(error.describe());
    return texts;
  };
  const std::string link = "c.yaml:3:10: there is no link 'fot' (did you mean 'foot'?)";
  EXPECT_THAT(complaints(nullptr), ElementsAre(link));
  EXPECT_THAT(complaints(&scene),
              ElementsAre(link,
                          "c.yaml:3:23: there is no object in the scene 'tabel' (did you mean "
                          "'table'?)"));
}

TEST(PlanningSettings, HaveAFloorWhereTheyNameOne) {
  const auto space = [](const std::string& more) {
    const Node block = parse("{unknown: free, outside: free" + more + "}");
    std::vector<Error> errors;
    check_against_schema(block, PlanningSettings::parameters().schema(), {}, errors);
    PlanningSettings settings;
    PlanningSettings::parameters().read(block, settings, errors);
    EXPECT_TRUE(errors.empty()) << errors.front().describe();
    return settings.space();
  };
  EXPECT_FALSE(space("").floor);
  EXPECT_FALSE(space(", floor: null").floor);
  ASSERT_TRUE(space(", floor: {}").floor);
  EXPECT_EQ(space(", floor: {}").floor->height_m, 0.0);
  EXPECT_THAT(space(", floor: {}").floor->except_links, ElementsAre());
  const auto floor = space(", floor: {height_m: -0.25, except_links: [foot, arm]}").floor;
  EXPECT_EQ(floor->height_m, -0.25);
  EXPECT_THAT(floor->except_links, ElementsAre("foot", "arm"));
}

TEST(PlanningSettings, NameLinksOfTheRobotThatStandOnTheFloor) {
  RobotDescription robot = small_robot();
  robot.links = {{"foot", -1}, {"arm", 0}};
  const auto complaints = [&](const std::string& text) {
    const Node block = parse("unknown: free\noutside: free\n" + text);
    std::vector<Error> errors;
    check_against_schema(block, PlanningSettings::parameters().schema(), {}, errors);
    check_floor(block, robot, errors);
    std::vector<std::string> texts;
    for (const Error& error : errors) texts.push_back(error.describe());
    return texts;
  };
  EXPECT_THAT(complaints(""), ElementsAre());
  EXPECT_THAT(complaints("floor: {except_links: [arm, foot]}"), ElementsAre());
  EXPECT_THAT(complaints("floor: {except_links: [arm, fot]}"),
              ElementsAre("c.yaml:3:29: there is no link 'fot' (did you mean 'foot'?)"));
  EXPECT_THAT(complaints("floor: {except_links: foot}"), ElementsAre(HasSubstr("c.yaml:3:23")));
  EXPECT_THAT(complaints("floor: {height_m: low}"), ElementsAre(HasSubstr("c.yaml:3:19")));
  EXPECT_THAT(complaints("floor: {height_m: .nan}"), ElementsAre(HasSubstr("c.yaml:3:19")));
  EXPECT_THAT(complaints("floor: {hight_m: 0}"), ElementsAre(HasSubstr("height_m")));
  EXPECT_THAT(complaints("floor: 0.1"), ElementsAre(HasSubstr("c.yaml:3:8")));
}

TEST(RobotState, NeedsNoPose) {
  const Reading reading = read("joints: {base_x: 1, shoulder: -1.5, elbow: 2.5}");
  EXPECT_THAT(reading.errors, ElementsAre());
  EXPECT_EQ(reading.q, Eigen::Vector3d(1.0, -1.5, 2.5));
}

TEST(RobotState, NamesEveryMissingJoint) {
  EXPECT_THAT(read("pose: home").errors,
              ElementsAre(AllOf(HasSubstr("c.yaml:1:"), HasSubstr("nothing of 'base_x'"))));
  EXPECT_THAT(read("joints: {shoulder: 0}").errors,
              ElementsAre(HasSubstr("nothing of 'base_x', 'elbow'")));
}

TEST(RobotState, OffersTheNearestNames) {
  EXPECT_THAT(read("pose: hone\njoints: {base_x: 0}").errors,
              ElementsAre("c.yaml:1:7: robot 'small' has no pose 'hone' (did you mean 'home'?)"));
  EXPECT_THAT(
      read("pose: home\njoints:\n  base_y: 0").errors,
      ElementsAre("c.yaml:3:3: robot 'small' has no joint 'base_y' (did you mean 'base_x'?)"));
}

TEST(RobotState, RefusesWhatIsNoNumberOrBeyondALimit) {
  EXPECT_THAT(read("pose: home\njoints: {base_x: far}").errors,
              ElementsAre(HasSubstr("c.yaml:2:")));
  EXPECT_THAT(read("pose: home\njoints: {base_x: .nan}").errors,
              ElementsAre(HasSubstr("finite number")));
  EXPECT_THAT(read("pose: home\njoints: {base_x: 2.001}").errors,
              ElementsAre("c.yaml:2:18: joint 'base_x' is at 2.001 m, outside its limits [-2, 2]"));
  EXPECT_THAT(read("pose: bent").errors, ElementsAre(HasSubstr("'shoulder' is at 9 rad")));
  EXPECT_THAT(read("pose: home\njoints: [1, 2]").errors, ElementsAre(HasSubstr("expected a map")));
}

TEST(PlanningSettings, RequireAChoiceForUnseenSpace) {
  const Node block = parse("unknown: perhaps");
  std::vector<Error> errors;
  check_against_schema(block, PlanningSettings::parameters().schema(), {}, errors);
  ASSERT_EQ(errors.size(), 2u);  // a wrong choice for one, nothing for the other
  EXPECT_THAT(errors[0].describe() + errors[1].describe(),
              AllOf(HasSubstr("perhaps"), HasSubstr("outside")));
}

TEST(PlanningSettings, ReadWeightsInheritedFromTheCosts) {
  const Node block =
      parse("{unknown: free, outside: occupied, sigma_obstacle: 0.125, epsilon_m: 0.3}");
  std::vector<Error> errors;
  check_against_schema(block, PlanningSettings::parameters().schema(), {}, errors);
  PlanningSettings settings;
  PlanningSettings::parameters().read(block, settings, errors);
  ASSERT_TRUE(errors.empty()) << errors.front().describe();
  EXPECT_EQ(settings.sigma_obstacle, 0.125);
  EXPECT_EQ(settings.epsilon_m, 0.3);
  EXPECT_EQ(settings.space().unknown, Space::kFree);
  EXPECT_EQ(settings.space().outside, Space::kOccupied);
}

TEST(MakeProblem, PlacesSelfCollisionWhereTheSettingsSay) {
  const auto robot = testing_support::mobile_arm();
  const auto placement = [&](const std::string& more) {
    PlanningSettings settings;
    std::vector<Error> errors;
    PlanningSettings::parameters().read(parse("{unknown: free, outside: free" + more + "}"),
                                        settings, errors);
    EXPECT_TRUE(errors.empty());
    const Eigen::VectorXd q = Eigen::VectorXd::Constant(robot->description().dof(), 0.1);
    const Problem problem = make_problem(robot, nullptr, settings, q, q);
    for (const CostTerm& term : problem.terms) {
      if (term.cost->name() == "self_collision") return std::optional(term.placement);
    }
    return std::optional<Placement>();
  };
  EXPECT_EQ(placement(""), Placement::kSupportAndInterpolated);
  EXPECT_EQ(placement(", self_collision_placement: support"), Placement::kSupport);
  EXPECT_EQ(placement(", sigma_self_collision: 0"), std::nullopt);
}

TEST(MakeProblem, KeepsTheArmFromTheFloor) {
  const auto robot = testing_support::mobile_arm();
  PlanningSettings settings;
  settings.unknown = settings.outside = "free";
  const Eigen::VectorXd q = Eigen::VectorXd::Constant(robot->description().dof(), 0.1);
  const auto has_floor = [&] {
    const Problem problem = make_problem(robot, nullptr, settings, q, q);
    return std::ranges::any_of(problem.terms, [](const CostTerm& term) {
      return term.cost->name() == "floor" && term.placement == Placement::kSupportAndInterpolated;
    });
  };
  EXPECT_FALSE(has_floor());
  settings.floor = FloorEntry{{0.0, {"base"}}};
  EXPECT_TRUE(has_floor());
  EXPECT_EQ(make_problem(robot, nullptr, settings, q, q).space.floor->except_links.at(0), "base");
}

TEST(MakeProblem, TakesItsTimeFromTheLimitsOrFromTheSettings) {
  const auto robot = testing_support::flying_ball(0.1);  // 2 m/s; no acceleration limits
  robot->description().joints[1].max_acceleration = 1.0;
  PlanningSettings settings;
  settings.unknown = settings.outside = "free";
  settings.dt_s = 0.1;
  settings.speed_fraction = 0.5;
  settings.acceleration_fraction = 0.25;
  settings.assumed_ramp_s = 0.5;
  settings.duration_scale = 1.5;
  const Eigen::Vector3d start(0.0, 0.0, 0.0);
  const auto intervals = [&](const Eigen::Vector3d& goal, double slower) {
    return make_problem(robot, nullptr, settings, start, goal, slower).support_states - 1;
  };
  // y: 1 m at 0.25 m/s^2, a triangle of 2 sqrt(1 / 0.25) = 4 s.
  EXPECT_EQ(intervals({0.0, 1.0, 0.0}, 1.0), 60);
  EXPECT_EQ(intervals({0.0, 1.0, 0.0}, 1.25), 75);
  // x: taken to reach 2 m/s in 0.5 s, a quarter of that is 1 m/s^2: 2 / 1 + 1 / 1 = 3 s.
  EXPECT_EQ(intervals({2.0, 0.0, 0.0}, 1.0), 45);
  EXPECT_EQ(intervals(start, 1.0), 2);
  settings.duration_s = 2.05;
  EXPECT_EQ(intervals({2.0, 1.0, 0.0}, 1.0), 21);
  settings.duration_s = 3600.0;
  EXPECT_EQ(intervals(start, 1e3), 9'999);
}

}  // namespace
}  // namespace sidestep
