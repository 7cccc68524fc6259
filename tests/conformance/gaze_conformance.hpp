#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/gaze.hpp>

#include "analytic_models.hpp"

/// What every Gaze must hold. In a test of your own:
///
///     INSTANTIATE_TEST_SUITE_P(mine, GazeConformance,
///                              testing::Values(GazeCase{"mine", [] { return make_mine(); }}));
namespace sidestep::conformance {

struct GazeCase {
  std::string name;
  /// A new one for a robot.
  std::function<std::shared_ptr<Gaze>(std::shared_ptr<const RobotModel>)> make;

  friend std::ostream& operator<<(std::ostream& out, const GazeCase& c) { return out << c.name; }
};

/// A disc of 0.2 m that drives in the plane, with a camera 1 m above it on a pan and a tilt joint:
/// +-2 rad and -1.2 to 0.5 rad, 1 rad/s, 3 rad/s^2. Links "base", "pan", "tilt", "camera".
[[nodiscard]] inline std::shared_ptr<const KinematicTree> robot_with_head() {
  RobotDescription robot;
  robot.name = "looker";
  robot.joints = {{"x", Joint::Type::kPrismatic, -50.0, 50.0, 0.5, 1.0},
                  {"y", Joint::Type::kPrismatic, -50.0, 50.0, 0.5, 1.0}};
  robot.links = {{"world", -1}, {"base_x", 0}, {"base", 1}, {"pan", 2}, {"tilt", 3}, {"camera", 4}};
  robot.spheres = {{2, {0.0, 0.0, 0.2}, 0.2}};
  robot.shapes = {{2, Sphere{0.2}, Transform(Eigen::Translation3d(0.0, 0.0, 0.2))}};
  using Motion = TreeJoint::Motion;
  std::vector<TreeJoint> joints{{"root"},
                                {"x", Motion::kTranslation},
                                {"y", Motion::kTranslation},
                                {"pan", Motion::kRotation},
                                {"tilt", Motion::kRotation},
                                {"optical"}};
  joints[1].axis = Eigen::Vector3d::UnitX();
  joints[1].joint = 0;
  joints[2].axis = Eigen::Vector3d::UnitY();
  joints[2].joint = 1;
  joints[3].T_parent_joint.translation().z() = 1.0;
  joints[4].axis = -Eigen::Vector3d::UnitY();  // up is positive
  joints[5].T_parent_joint = T_forward_optical();
  const auto axis = [](const char* name, double lower, double upper, int link) {
    return HeadDescription::Axis{{name, Joint::Type::kRevolute, lower, upper, 1.0, 3.0}, link};
  };
  robot.head = HeadDescription{axis("pan", -2.0, 2.0, 3), axis("tilt", -1.2, 0.5, 4), 5};
  auto tree = KinematicTree::create(std::move(robot), std::move(joints));
  if (!tree) throw std::runtime_error(tree.error().describe());
  return std::move(*tree);
}

/// The robot above, and a request about it.
class Looker {
 public:
  explicit Looker(std::shared_ptr<const RobotModel> robot = robot_with_head())
      : robot_(std::move(robot)), head_(*Head::create(robot_)) {
    stand(Eigen::VectorXd::Zero(robot_->description().dof()));
  }

  void stand(const Eigen::VectorXd& q) {
    state = {q, Eigen::VectorXd::Zero(q.size())};
    T_world_link.resize(robot_->description().links.size());
    Scratch scratch;
    robot_->link_poses(as_span(q), T_world_link, scratch);
  }
  /// Along a straight line from here, at a constant speed.
  void drive_to(const Eigen::VectorXd& q, double duration_s) {
    const Eigen::VectorXd qdot = (q - state.q) / duration_s;
    way = straight_line({state.q, qdot}, {q, qdot}, 11, duration_s / 10);
  }
  /// Takes a frame from where the camera is.
  void take_frame() {
    camera = CameraView{now.seconds(),
                        head_.T_world_camera(at, T_world_link),
                        {640, 480, 554.38, 554.38, 319.5, 239.5}};
  }

  [[nodiscard]] GazeRequest request() const {
    GazeRequest request{now, *robot_, state, T_world_link, head_, at};
    request.way = way.size() > 0 ? &way : nullptr;
    request.field = field.get();
    request.way_blocked_s = blocked_s;
    request.tracks = tracks ? &*tracks : nullptr;
    request.moving = moving ? &*moving : nullptr;
    request.camera = camera ? &*camera : nullptr;
    return request;
  }
  [[nodiscard]] const Head& head() const noexcept { return head_; }
  [[nodiscard]] const std::shared_ptr<const RobotModel>& robot() const noexcept { return robot_; }

  Stamp now{2'000'000'000};
  HeadAngles at;
  RobotState state;
  std::vector<Transform> T_world_link;
  Trajectory way;
  std::shared_ptr<const DistanceField> field;
  std::optional<double> blocked_s;
  std::optional<Tracks> tracks;
  std::optional<MovingObstacles> moving;
  std::optional<CameraView> camera;

 private:
  std::shared_ptr<const RobotModel> robot_;
  Head head_;
};

class GazeConformance : public testing::TestWithParam<GazeCase> {
 protected:
  void give_everything() {
    looker_.field = std::make_shared<BallField>(
        std::vector<Ball>{{{2.0, 0.0, 0.9}, 0.5}, {{-3.0, 2.0, 0.9}, 1.0}});
    looker_.drive_to(Eigen::Vector2d(3.0, 1.0), 10.0);
    Track track;
    track.id = 7;
    track.position_m = {1.0, -2.0};
    track.top_m = 1.8;
    track.last_seen = {looker_.now.ns - 700'000'000};
    looker_.tracks = Tracks{{track}, looker_.now};
    looker_.blocked_s = 4.0;
    looker_.moving = MovingObstacles{{{{-1.0, 1.0, 0.9}, 0.2, Stamp{looker_.now.ns - 500'000'000}}},
                                     looker_.now};
    looker_.take_frame();
  }
  /// Of a new gaze, asked ten times a second while the head turns as it says.
  std::vector<HeadAngles> looks(int times) {
    const auto gaze = GetParam().make(looker_.robot());
    std::vector<HeadAngles> said;
    for (int i = 0; i < times; ++i) {
      const auto angles = gaze->look(looker_.request());
      if (!angles) {
        ADD_FAILURE() << angles.error().describe();
        return said;
      }
      EXPECT_TRUE(std::isfinite(angles->pan_rad) && std::isfinite(angles->tilt_rad));
      said.push_back(*angles);
      looker_.at = looker_.head().within_limits(*angles);
      looker_.now.ns += 100'000'000;
      if (looker_.camera) looker_.take_frame();
    }
    return said;
  }

  Looker looker_;
};

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(GazeConformance);

TEST_P(GazeConformance, LooksSomewhereBeforeThereIsAMapOrAWay) { looks(5); }

TEST_P(GazeConformance, LooksSomewhereInAMapOnItsWay) {
  give_everything();
  looks(30);
}

TEST_P(GazeConformance, LooksSomewhereAtTheEndOfItsWay) {
  give_everything();
  looker_.stand(Eigen::Vector2d(3.0, 1.0));
  looker_.way = straight_line(looker_.state, looker_.state, 2, 0.1);
  looks(5);
}

TEST_P(GazeConformance, LooksTheSameWayAtTheSameThings) {
  give_everything();
  const Looker before = looker_;
  const std::vector<HeadAngles> first = looks(20);
  looker_ = before;
  const std::vector<HeadAngles> second = looks(20);
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].pan_rad, second[i].pan_rad) << i;
    EXPECT_EQ(first[i].tilt_rad, second[i].tilt_rad) << i;
  }
}

}  // namespace sidestep::conformance
