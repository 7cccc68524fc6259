#include <gtest/gtest.h>

#include <random>

#include <sidestep/planning/motion_check.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "support/chain_robot.hpp"
#include "support/opaque_field.hpp"
#include "support/voxel_field.hpp"

namespace sidestep {

inline void PrintTo(const SpacePolicy& space, std::ostream* out) {
  *out << (space.unknown == Space::kFree ? "unknown free" : "unknown occupied")
       << (space.outside == Space::kFree ? ", outside free" : ", outside occupied")
       << (space.floor ? ", floor" : "");
}

namespace {

using testing_support::Aabb;
using testing_support::mobile_arm;
using testing_support::VoxelWorld;

constexpr double kSampling_s = 1e-4;
constexpr double kSlack_m = 1e-9;

/// The least clearance of the robot at one configuration, from the definitions alone.
class Oracle {
 public:
  Oracle(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const DistanceField> field,
         SpacePolicy space)
      : robot_(std::move(robot)), field_(std::move(field)), space_(space) {}

  struct Clearance {
    double field_m = std::numeric_limits<double>::infinity();
    double self_m = std::numeric_limits<double>::infinity();
  };
  Clearance operator()(std::span<const double> q) {
    const RobotDescription& d = robot_->description();
    centres_.resize(d.spheres.size());
    robot_->sphere_centres(q, centres_, scratch_);
    Clearance out;
    for (std::size_t s = 0; s < d.spheres.size(); ++s) {
      const std::string& link = d.links[static_cast<std::size_t>(d.spheres[s].link)].name;
      if (space_.floor && link != space_.floor->except_links.at(0)) {
        const double lowest_m = centres_[s].z() - d.spheres[s].radius_m;
        out.field_m = std::min(out.field_m, lowest_m - space_.floor->height_m);
        if (lowest_m < space_.floor->height_m) ++in_floor_;
      }
      double distance = 0.0;
      FieldStatus status = FieldStatus::kKnown;
      field_->query({&centres_[s], 1}, {&distance, 1}, {}, {&status, 1});
      if (status == FieldStatus::kUnknown && space_.unknown == Space::kOccupied) distance = -1.0;
      if (status == FieldStatus::kOutside) {
        distance = space_.outside == Space::kOccupied ? -1.0 : 10.0;
      }
      out.field_m = std::min(out.field_m, distance - d.spheres[s].radius_m);
    }
    for (const auto& [first, second] : d.self_collision_pairs) {
      for (std::size_t a = 0; a < d.spheres.size(); ++a) {
        for (std::size_t b = 0; b < d.spheres.size(); ++b) {
          if (d.spheres[a].link != first || d.spheres[b].link != second) continue;
          out.self_m = std::min(out.self_m, (centres_[a] - centres_[b]).norm() -
                                                d.spheres[a].radius_m - d.spheres[b].radius_m);
        }
      }
    }
    return out;
  }
  /// Spheres that were found in the floor.
  [[nodiscard]] int in_floor() const { return in_floor_; }

 private:
  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const DistanceField> field_;
  SpacePolicy space_;
  int in_floor_ = 0;
  Scratch scratch_;
  std::vector<Eigen::Vector3d> centres_;
};

VoxelWorld random_world(std::mt19937& random, bool with_unknown) {
  std::uniform_real_distribution<double> across(-1.7, 1.7);
  std::uniform_real_distribution<double> up(0.0, 1.5);
  std::uniform_real_distribution<double> size(0.05, 0.35);
  VoxelWorld world;
  world.grid = {{-2.0, -2.0, -0.3}, 0.1, {40, 40, 22}};
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d centre(across(random), across(random), up(random));
    const Eigen::Vector3d half(size(random), size(random), size(random));
    auto& boxes = with_unknown && i < 3 ? world.unknown : world.occupied;
    boxes.push_back({centre - half, centre + half});
  }
  world.is_signed = random() % 2 == 0;
  return world;
}

Eigen::VectorXd random_configuration(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Eigen::VectorXd q(7);
  q << 1.2 * unit(random), 1.2 * unit(random), 3.0 * unit(random), 0.2 + 0.2 * unit(random),
      -1.0 + 1.5 * unit(random), 2.1 * unit(random), 1.8 * unit(random);
  return q;
}

Trajectory random_trajectory(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  constexpr int kStates = 5;
  Trajectory trajectory = make_trajectory(7, kStates, 0.25);
  const Eigen::VectorXd start = random_configuration(random);
  Eigen::VectorXd step = 0.3 * (random_configuration(random) - start) / (kStates - 1);
  for (int i = 0; i < kStates; ++i) {
    for (int j = 0; j < 7; ++j) {
      const auto at = static_cast<std::size_t>(j);
      trajectory.q(i)[at] = start[j] + i * step[j] + 0.02 * unit(random);
      trajectory.qdot(i)[at] = step[j] / 0.25 + 0.3 * unit(random);
    }
  }
  return trajectory;
}

/// Limits are not the subject here: wide enough for anything random_trajectory() makes.
std::shared_ptr<RobotModel> unlimited_arm() {
  auto robot = mobile_arm();
  for (Joint& joint : robot->description().joints) {
    if (joint.type != Joint::Type::kPrismatic || std::isinf(joint.upper)) {
      joint.lower = -100.0;
      joint.upper = 100.0;
    } else {
      joint.lower -= 1.0;
      joint.upper += 1.0;
    }
    joint.max_velocity = 100.0;
  }
  return robot;
}

class NeverFalselyValid : public testing::TestWithParam<SpacePolicy> {};

TEST_P(NeverFalselyValid, AgreesWithDenseSampling) {
  const SpacePolicy space = GetParam();
  const auto robot = unlimited_arm();
  std::mt19937 random(17);
  int valid = 0;
  int invalid = 0;
  int unknown = 0;
  int in_floor = 0;
  for (int w = 0; w < 6; ++w) {
    std::shared_ptr<const DistanceField> field = random_world(random, true).field();
    if (w % 2 == 1) field = std::make_shared<testing_support::OpaqueField>(field);
    FieldCheckSettings settings;
    settings.margin_m = 0.02 * (w % 3);
    const auto check = make_field_check(robot, field, space, settings);
    Oracle oracle(robot, field, space);
    for (int i = 0; i < 25; ++i) {
      const Trajectory trajectory = random_trajectory(random);
      const auto verdict = check->check(trajectory, 0.0, Deadline());
      ASSERT_TRUE(verdict) << verdict.error().describe();
      std::vector<double> q(7);
      if (verdict->valid()) {
        ++valid;
        for (double t = 0.0; t <= trajectory.duration_s(); t += kSampling_s) {
          trajectory.sample(t, q, {});
          const auto clearance = oracle(q);
          ASSERT_GE(clearance.field_m, settings.margin_m - kSlack_m) << "at " << t;
          ASSERT_GE(clearance.self_m, -kSlack_m) << "at " << t;
        }
      } else if (verdict->outcome == Verdict::Outcome::kInvalid) {
        ++invalid;
        for (const Violation& violation : verdict->violations) {
          trajectory.sample(violation.time_s, q, {});
          const auto clearance = oracle(q);
          if (violation.kind == Violation::Kind::kCollision) {
            EXPECT_LT(clearance.field_m, settings.margin_m) << violation.describe();
          } else if (violation.kind == Violation::Kind::kSelfCollision) {
            EXPECT_LT(clearance.self_m, 0.0) << violation.describe();
          } else {
            EXPECT_EQ(violation.kind, Violation::Kind::kUnproven) << violation.describe();
          }
        }
      } else {
        ++unknown;
      }
    }
    in_floor += oracle.in_floor();
  }
  EXPECT_GE(in_floor, space.floor ? 10 : 0);
  // The sample holds enough of both, and hardly anything remains undecided.
  EXPECT_GE(valid, 10);
  EXPECT_GE(invalid, 30);
  EXPECT_LE(unknown, 3);
}

INSTANTIATE_TEST_SUITE_P(
    Policies, NeverFalselyValid,
    testing::Values(SpacePolicy{Space::kOccupied, Space::kOccupied},
                    SpacePolicy{Space::kFree, Space::kOccupied},
                    SpacePolicy{Space::kOccupied, Space::kFree},
                    SpacePolicy{Space::kFree, Space::kFree},
                    SpacePolicy{Space::kOccupied, Space::kOccupied, Floor{0.45, {"base"}}},
                    SpacePolicy{Space::kFree, Space::kFree, Floor{0.45, {"base"}}}));

class MotionCheckAgrees : public testing::TestWithParam<SpacePolicy> {};

TEST_P(MotionCheckAgrees, WithDenseSamplingOfStraightMotions) {
  const SpacePolicy& space = GetParam();
  const auto robot = unlimited_arm();
  constexpr double kMargin_m = 0.01;
  std::mt19937 random(3);
  int clear = 0;
  int blocked = 0;
  int wrongly_blocked = 0;
  for (int w = 0; w < 4; ++w) {
    const auto field = random_world(random, true).field();
    MotionCheck check(robot, field, space, kMargin_m);
    Oracle oracle(robot, field, space);
    for (int i = 0; i < 100; ++i) {
      const Eigen::VectorXd from = random_configuration(random);
      const Eigen::VectorXd to = from + 0.15 * (random_configuration(random) - from);
      double least_m = std::numeric_limits<double>::infinity();
      for (int k = 0; k <= 2000; ++k) {
        const Eigen::VectorXd q = from + k / 2000.0 * (to - from);
        const auto clearance = oracle({q.data(), 7});
        least_m = std::min({least_m, clearance.field_m - kMargin_m, clearance.self_m});
      }
      const bool is_clear = check.is_clear({from.data(), 7}, {to.data(), 7}, 0.005);
      if (is_clear) {
        ++clear;
        ASSERT_GE(least_m, -kSlack_m);
      } else {
        ++blocked;
        // A blocked motion collides, or comes within what 5 mm of motion cannot resolve.
        if (least_m > 0.005) ++wrongly_blocked;
      }
      EXPECT_EQ(check.is_clear({from.data(), 7}), oracle({from.data(), 7}).field_m >= kMargin_m &&
                                                      oracle({from.data(), 7}).self_m >= 0.0);
    }
  }
  EXPECT_GE(clear, 30);
  EXPECT_GE(blocked, 30);
  EXPECT_LE(wrongly_blocked, 2);  // those that pass within 5 mm of unknown space or the border
}

INSTANTIATE_TEST_SUITE_P(Policies, MotionCheckAgrees,
                         testing::Values(SpacePolicy{Space::kOccupied, Space::kOccupied},
                                         SpacePolicy{Space::kOccupied, Space::kOccupied,
                                                     Floor{0.4, {"base"}}}));

}  // namespace
}  // namespace sidestep
