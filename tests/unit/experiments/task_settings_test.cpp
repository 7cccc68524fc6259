#include <sidestep/runtime/task_settings.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/runtime/yaml_document.hpp>

#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class TaskSettings : public testing::Test {
 protected:
  Task read(const std::string& text) {
    std::vector<Error> errors;
    const auto node = parse_yaml(text, "task.yaml", errors);
    EXPECT_TRUE(node && errors.empty()) << text;
    Task task = read_task(node.value_or(Node()), robot_, errors);
    errors_.clear();
    for (const Error& error : errors) {
      EXPECT_EQ(error.code, ErrorCode::kConfig);
      errors_.push_back(error.describe());
    }
    return task;
  }

  const std::shared_ptr<const RobotModel> robot_ = testing_support::mobile_arm();
  std::vector<std::string> errors_;
};

TEST_F(TaskSettings, BecomeCostTerms) {
  const Task task = read(
      "end_effector: {link: hand, position_m: [1, 0, 0.5], rpy_rad: [0, 1, 0]}\n"
      "orientation_costs: [{link: fore_arm, rpy_rad: [0, 0, 0]}]\n"
      "axis_costs: [{link: hand}, {link: base, axis_link: [1, 0, 0]}]\n"
      "posture_cost: {joints: {elbow: 0.3}, sigma: 0.1}\n");
  EXPECT_THAT(errors_, ElementsAre());
  std::vector<std::string> names;
  for (const CostTerm& term : task.terms) names.emplace_back(term.cost->name());
  EXPECT_THAT(
      names, ElementsAre("pose_hand", "orientation_fore_arm", "axis_hand", "axis_base", "posture"));
  EXPECT_EQ(task.terms[0].placement, Placement::kGoal);
  EXPECT_EQ(task.terms[2].placement, Placement::kSupportAndInterpolated);
  EXPECT_TRUE(task.frees_goal);

  const Task position = read("end_effector: {link: hand, position_m: [1, 0, 0.5]}");
  EXPECT_EQ(position.terms.at(0).cost->name(), "position_hand");
  EXPECT_TRUE(position.frees_goal);
  EXPECT_FALSE(read("axis_costs: [{link: hand}]").frees_goal);
  EXPECT_TRUE(read("name: nothing").terms.empty());
}

TEST_F(TaskSettings, LeaveATargetOpen) {
  const Task task = read(
      "end_effector: {link: hand, position_m: [1, 0, 0.5], within_m: [0.2, 0, 0.1],\n"
      "  axis_link: [0, 0, 1], axis_world: [0, 0, -1], alternatives: [{position_m: [0, 1, 0.5]}]}");
  EXPECT_THAT(errors_, ElementsAre());
  ASSERT_EQ(task.terms.size(), 2u);
  EXPECT_EQ(task.terms[0].cost->name(), "position_hand");
  EXPECT_EQ(task.terms[1].cost->name(), "axis_hand");
  EXPECT_EQ(task.terms[1].placement, Placement::kGoal);
  EXPECT_EQ(task.target.value().within_m, Eigen::Vector3d(0.2, 0.0, 0.1));
}

TEST_F(TaskSettings, SayWhereATargetContradictsItself) {
  const auto error_of = [&](const std::string& rest) {
    (void)read("end_effector: {link: hand, position_m: [1, 0, 0],\n " + rest + "}");
    return errors_.size() == 1 ? errors_[0] : std::to_string(errors_.size()) + " errors";
  };
  EXPECT_THAT(error_of("rpy_rad: [0, 0, 0], axis_link: [1, 0, 0]"),
              HasSubstr("`rpy_rad` says already how the link is turned"));
  EXPECT_THAT(error_of("axis_world: [1, 0, 0]"), HasSubstr("there is no `axis_link`"));
  EXPECT_THAT(error_of("rpy_rad: [0, 0, 0], alternatives: [{position_m: [1, 0, 1]}]"),
              AllOf(HasSubstr("task.yaml:2:37"), HasSubstr("this alternative has no `rpy_rad`")));
}

TEST_F(TaskSettings, SayWhereANameIsWrong) {
  (void)read(
      "end_effector: {link: hnd, position_m: [1, 0, 0.5]}\n"
      "axis_costs: [{link: hand, axis_link: [0, 0, 0]}]\n"
      "posture_cost: {joints: {elbw: 0.3}}\n");
  ASSERT_EQ(errors_.size(), 3u);
  EXPECT_THAT(errors_[0], HasSubstr("task.yaml:1:22"));
  EXPECT_THAT(errors_[0], HasSubstr("robot 'mobile_arm' has no link 'hnd' (did you mean 'hand'?)"));
  EXPECT_THAT(errors_[1], HasSubstr("task.yaml:2:14"));
  EXPECT_THAT(errors_[1], HasSubstr("no direction"));
  EXPECT_THAT(errors_[2], HasSubstr("task.yaml:3:25"));
  EXPECT_THAT(errors_[2], HasSubstr("has no joint 'elbw' (did you mean 'elbow'?)"));
}

TEST_F(TaskSettings, PassOverWhatTheirSchemaRefuses) {
  const Task task = read(
      "end_effector: {position_m: [1, 0, 0.5]}\n"
      "axis_costs: [{link: hand, sigma_rad: -1}, 3]\n"
      "posture_cost: nothing\n");
  EXPECT_THAT(errors_, ElementsAre());
  EXPECT_TRUE(task.terms.empty());
}

}  // namespace
}  // namespace sidestep
