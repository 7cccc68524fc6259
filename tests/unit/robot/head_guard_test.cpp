#include "head_guard.hpp"

#include <random>

#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/field/scene_field.hpp>
#include <sidestep/runtime/gaze_loop.hpp>
#include <sidestep/runtime/truth_check.hpp>

#include "conformance/test_host.hpp"
#include "robot_testing.hpp"

namespace sidestep {
namespace {

/// The HSR, whose arm stands before its head.
class HsrsHeadGuard : public ::testing::Test {
 protected:
  [[nodiscard]] Eigen::VectorXd pose(const std::string& name) const {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(robot_->description().dof());
    const NamedPose* named = robot_->description().find_pose(name);
    for (Eigen::Index j = 0; j < q.size(); ++j) {
      if (const auto& value = named->positions[idx(j)]) q[j] = *value;
    }
    return q;
  }
  /// The contacts of the head with the rest of the robot, by what judges episodes.
  [[nodiscard]] std::vector<TrueContact> contacts(const std::vector<TruePose>& poses) const {
    const auto motion = check_true_motion(robot_, std::make_shared<const Scene>(), poses, {});
    EXPECT_TRUE(motion) << motion.error().describe();
    return motion->contacts;
  }
  /// Whatever its joints do on the way from there to its rest.
  [[nodiscard]] std::vector<TruePose> turns_home(const Eigen::VectorXd& q,
                                                 const HeadAngles& from) const {
    std::vector<TruePose> poses;
    constexpr int kSteps = 12;
    for (int i = 0; i <= kSteps * kSteps; ++i) {
      const double pan = static_cast<double>(i % kSteps) / (kSteps - 1);
      const double tilt = static_cast<double>(i / kSteps) / kSteps;
      poses.push_back({0.01 * i, q,
                       HeadAngles{from.pan_rad + pan * (head_.rest().pan_rad - from.pan_rad),
                                  from.tilt_rad + tilt * (head_.rest().tilt_rad - from.tilt_rad)}});
    }
    return poses;
  }

  testing_robot::Loader loader_;
  std::shared_ptr<const RobotModel> robot_{loader_.load_or_fail("{profile: hsr}")};
  Head head_ = *Head::create(robot_);
  HeadGuard guard_{robot_, head_, 0.02};
};

TEST_F(HsrsHeadGuard, LetsTheHeadTurnAnywhereWhereTheArmIsOutOfItsWay) {
  const Eigen::VectorXd drive = pose("drive");
  guard_.see(as_span(drive), nullptr, 0.0);
  EXPECT_TRUE(guard_.is_clear({{-3.84, -1.57}, {1.75, 0.52}}));
  const Eigen::VectorXd go = pose("go");
  guard_.see(as_span(go), nullptr, 0.0);
  EXPECT_TRUE(guard_.is_clear({head_.rest()}));
  EXPECT_FALSE(guard_.is_clear({{0.0, -1.5}}));
  EXPECT_FALSE(contacts({{0.0, go, HeadAngles{0.0, -1.5}}}).empty());
}

TEST_F(HsrsHeadGuard, KnowsTheWayAhead) {
  const Eigen::VectorXd drive = pose("drive");
  Eigen::VectorXd raised = drive;
  raised[3] = 0.3;   // the arm goes up,
  raised[4] = -0.1;  // to before the head
  Trajectory way = make_trajectory(static_cast<int>(drive.size()), 2, 3.0);
  std::ranges::copy(as_span(drive), way.q(0).begin());
  std::ranges::copy(as_span(raised), way.q(1).begin());
  guard_.see(as_span(drive), nullptr, 0.0);
  EXPECT_TRUE(guard_.is_clear({{0.0, -1.2}}));
  guard_.see(as_span(drive), &way, 0.0);
  EXPECT_FALSE(guard_.is_clear({{0.0, -1.2}}));
}

/// An independent look at what it lets pass: FCL at angles between, by check_true_motion().
TEST_F(HsrsHeadGuard, LetsNothingPassThatTouches) {
  std::mt19937 random(11);
  int clear = 0, touching = 0;
  for (int i = 0; i < 150; ++i) {
    Eigen::VectorXd q = pose("go");
    for (Eigen::Index j = 3; j < q.size(); ++j) {
      const Joint& joint = robot_->description().joints[idx(j)];
      std::uniform_real_distribution<double> offset(-0.4, 0.4);
      q[j] = std::clamp(q[j] + offset(random), joint.lower, joint.upper);
    }
    const HeadAngles to{std::uniform_real_distribution<double>(-2.0, 1.7)(random),
                        std::uniform_real_distribution<double>(-1.5, 0.5)(random)};
    guard_.see(as_span(q), nullptr, 0.0);
    const bool touches = !contacts(turns_home(q, to)).empty();
    touching += touches ? 1 : 0;
    if (!guard_.is_clear({to})) continue;
    ++clear;
    EXPECT_FALSE(touches) << q.transpose() << "; " << to.pan_rad << ", " << to.tilt_rad;
  }
  EXPECT_GT(clear, 20);
  EXPECT_GT(touching, 20);
}

/// The same with the edge of a board beside the head, which stays clear of it at its rest.
TEST_F(HsrsHeadGuard, LetsNothingPassThatTouchesAnObstacle) {
  const Eigen::VectorXd drive = pose("drive");
  std::vector<Transform> links(robot_->description().links.size());
  Scratch scratch;
  robot_->link_poses(as_span(drive), links, scratch);
  const Eigen::Vector3d pans_m = links[idx(head_.description().pan.link)].translation();
  std::mt19937 random(12);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  int clear = 0, touching = 0;
  for (int i = 0; i < 600; ++i) {
    const double side_rad = uniform(-3.1, 3.1), away_m = uniform(0.1, 0.25);
    const Eigen::Vector3d middle_m((away_m + 0.15) * std::cos(side_rad),
                                   (away_m + 0.15) * std::sin(side_rad), uniform(-0.1, 0.25));
    const Transform pose = transform_from_xyz_rpy(pans_m + middle_m, {0.0, 0.0, side_rad});
    const auto scene = std::make_shared<const Scene>(std::vector<SceneObject>{
        {.name = "board", .shape = Box{{0.3, 0.3, 0.04}}, .waypoints = {{0.0, pose}}}});
    const auto touches = [&](const std::vector<TruePose>& poses) {
      const auto motion = check_true_motion(robot_, scene, poses, {});
      EXPECT_TRUE(motion) << motion.error().describe();
      return !motion->contacts.empty();
    };
    if (touches({{0.0, drive, head_.rest()}})) continue;
    const HeadAngles to{uniform(-3.8, 1.7), uniform(-1.5, 0.5)};
    guard_.see(
        as_span(drive), nullptr, 0.0,
        std::make_shared<const SceneField>(
            *scene, Stamp{},
            Eigen::AlignedBox3d(Eigen::Vector3d::Constant(-3.0), Eigen::Vector3d::Constant(3.0))));
    const bool does = touches(turns_home(drive, to));
    touching += does ? 1 : 0;
    if (!guard_.is_clear({to})) continue;
    ++clear;
    EXPECT_FALSE(does) << away_m << " m, " << side_rad << "; " << to.pan_rad << ", " << to.tilt_rad;
  }
  EXPECT_GT(clear, 50);
  EXPECT_GT(touching, 50);
}

TEST_F(HsrsHeadGuard, IsJudgedWithTheHeadWhereItWas) {
  const Eigen::VectorXd go = pose("go");
  EXPECT_TRUE(contacts({{0.0, go, {}}, {0.1, go, {}}}).empty());
  const auto found = contacts({{0.0, go, head_.rest()}, {0.1, go, HeadAngles{0.0, -1.5}}});
  ASSERT_FALSE(found.empty());
  EXPECT_TRUE(found[0].is_own && found[0].is_by_robot());
  EXPECT_EQ(found[0].begin_s, 0.1);
  EXPECT_TRUE(found[0].link.starts_with("head_")) << found[0].link;
  EXPECT_FALSE(found[0].object.starts_with("head_")) << found[0].object;
}

class Turning final : public Executor, public HeadTurner {
 public:
  [[nodiscard]] Result<Measured> current() override { return fail(ErrorCode::kIo, "not asked"); }
  [[nodiscard]] Result<void> follow(const Trajectory&, Stamp) override { return {}; }
  [[nodiscard]] Result<void> stop() override { return {}; }
  [[nodiscard]] Result<void> turn_head(const HeadAngles& to) override {
    told = to;
    return {};
  }
  std::optional<HeadAngles> told;
};

class Down final : public Gaze {
 public:
  [[nodiscard]] Result<HeadAngles> look(const GazeRequest& request) override {
    may = request.may(wanted);
    if (fails) return fail(ErrorCode::kPlugin, "does not know");
    return wanted;
  }
  HeadAngles wanted{0.0, -1.4};
  bool may = true;
  bool fails = false;
};

/// A loop whose head is where it was told to be.
class HsrsGazeLoop : public HsrsHeadGuard {
 protected:
  void look(double time_s, const Eigen::VectorXd& q, const Trajectory* followed = nullptr,
            const Trajectory* way = nullptr) {
    const Stamp now = Stamp::from_seconds(time_s);
    motion_.record_head(executor_.told.value_or(head_.rest()), {now.ns - 50'000'000});
    motion_.record_head(executor_.told.value_or(head_.rest()), now);
    loop_->look(now, {q, Eigen::VectorXd::Zero(q.size())}, {way, 0.0, {}, followed, 0.0});
  }
  [[nodiscard]] Trajectory from_to(const Eigen::VectorXd& from, const Eigen::VectorXd& to,
                                   double in_s) const {
    Trajectory way = make_trajectory(static_cast<int>(from.size()), 2, in_s);
    std::ranges::copy(as_span(from), way.q(0).begin());
    std::ranges::copy(as_span(to), way.q(1).begin());
    return way;
  }
  [[nodiscard]] bool is_told(const HeadAngles& angles) const {
    return executor_.told && std::abs(executor_.told->pan_rad - angles.pan_rad) < 1e-9 &&
           std::abs(executor_.told->tilt_rad - angles.tilt_rad) < 1e-9;
  }

  Turning executor_;
  Down gaze_;
  RobotMotion motion_;
  SnapshotSlot slot_;
  conformance::RecordingLog log_;
  Result<GazeLoop> loop_ = GazeLoop::create(
      {robot_, gaze_, executor_, motion_, slot_, log_, "gaze down", "executor turning"});
};

TEST_F(HsrsGazeLoop, DoesNotTurnTheHeadIntoTheArm) {
  look(1.0, pose("go"));
  EXPECT_FALSE(gaze_.may);
  EXPECT_FALSE(executor_.told && executor_.told->tilt_rad < -0.4);
  look(1.1, pose("drive"));
  EXPECT_TRUE(gaze_.may);
  EXPECT_TRUE(is_told(gaze_.wanted));
}

TEST_F(HsrsGazeLoop, TurnsTheHeadToItsRestBeforeTheArmComesWhateverTheGazeSays) {
  const Eigen::VectorXd drive = pose("drive");
  const Trajectory way = from_to(drive, pose("go"), 3.0);
  for (const bool fails : {false, true}) {
    gaze_.fails = false;
    look(fails ? 3.0 : 1.0, drive);
    ASSERT_TRUE(is_told(gaze_.wanted));
    gaze_.fails = fails;
    look(fails ? 4.0 : 2.0, drive, &way);
    EXPECT_TRUE(is_told(head_.rest()));
  }
}

TEST_F(HsrsGazeLoop, LooksFreelyWhileTheRobotStandsBeforeABlockedWay) {
  const Eigen::VectorXd drive = pose("drive");
  const Trajectory way = from_to(drive, pose("go"), 3.0);
  look(1.0, drive, nullptr, &way);
  EXPECT_TRUE(is_told(gaze_.wanted));
}

TEST_F(HsrsGazeLoop, ObjectsToAMotionUntilTheHeadRests) {
  const Eigen::VectorXd drive = pose("drive");
  const Trajectory motion = from_to(drive, pose("go"), 3.0);
  EXPECT_EQ(loop_->objection(Stamp::from_seconds(0.5), motion), "");
  look(1.0, drive);
  ASSERT_TRUE(is_told(gaze_.wanted));
  look(1.1, drive);
  EXPECT_NE(loop_->objection(Stamp::from_seconds(1.1), motion), "");
  EXPECT_EQ(loop_->objection(Stamp::from_seconds(1.1), from_to(drive, drive, 3.0)), "");
  look(1.2, drive);  // goes to rest, for the next search
  EXPECT_TRUE(is_told(head_.rest()));
  look(1.3, drive);
  EXPECT_EQ(loop_->objection(Stamp::from_seconds(1.3), motion), "");
  look(4.0, drive);  // nobody went on
  EXPECT_TRUE(is_told(gaze_.wanted));
}

}  // namespace
}  // namespace sidestep
