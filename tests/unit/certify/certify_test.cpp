#include <cmath>

#include <gmock/gmock.h>

#include <sidestep/core/index.hpp>

#include "certify_testing.hpp"
#include "robot_testing.hpp"
#include "shape_collider.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;
using testing_certify::crane;
using testing_certify::crane_of;
using testing_certify::object;
using testing_certify::random_scene;
using testing_certify::straight;
using Outcome = Certification::Outcome;

Certification certified(const KinematicTree& robot, const CertifiedScene& scene,
                        const PolynomialMotion& motion, const CertifySettings& settings = {}) {
  auto found = certify(robot, scene, motion, settings);
  if (!found) throw std::runtime_error(found.error().describe());
  return std::move(*found);
}

class PandasCertificates : public ::testing::Test {
 protected:
  [[nodiscard]] std::vector<double> configuration(const PolynomialMotion& motion,
                                                  double time_s) const {
    std::vector<double> q;
    for (const PolynomialPiece& piece : motion.pieces) {
      if (time_s > piece.end_s && &piece != &motion.pieces.back()) continue;
      for (const auto& c : piece.coefficients) q.push_back(c[0] + c[1] * (time_s - piece.begin_s));
      break;
    }
    return q;
  }
  /// The least clearance that FCL finds at one instant.
  [[nodiscard]] double clearance_m(const ShapeCollider& collider, const std::vector<double>& q) {
    std::vector<Transform> links(robot_->description().links.size());
    robot_->link_poses(q, links, scratch_);
    const auto pose = collider.make_pose();
    collider.place(*pose, links, 0.0);
    double least_m = 1.0;
    for (int s = 0; s < collider.shape_count(); ++s) {
      const int link = robot_->description().shapes[idx(s)].link;
      if (link == 0) continue;  // no joint moves it
      least_m = std::min(least_m, collider.to_obstacles(s, *pose, least_m).clearance_m);
    }
    for (int p = 0; p < collider.pair_count(); ++p) {
      least_m = std::min(least_m, collider.between_pair(p, *pose, least_m));
    }
    return least_m;
  }

  testing_robot::Loader loader_;
  std::shared_ptr<const KinematicTree> robot_{loader_.load_or_fail("{profile: panda}")};
  Scratch scratch_;
};

/// FCL at many instants of random motions, which it alone does not prove.
TEST_F(PandasCertificates, AgreeWithFclAtManyInstants) {
  std::mt19937_64 random(3);
  const auto& joints = robot_->description().joints;
  int proven = 0, refuted = 0, undecided = 0;
  for (int k = 0; k < 60; ++k) {
    const Scene scene = random_scene(random, 8);
    std::vector<std::vector<double>> waypoints(2);
    for (auto& q : waypoints) {
      for (const Joint& joint : joints) {
        const double middle = 0.5 * (joint.lower + joint.upper);
        q.push_back(middle + std::uniform_real_distribution(-0.35, 0.35)(random) *
                                 (joint.upper - joint.lower));
      }
    }
    const PolynomialMotion motion = straight(waypoints, 5.0);
    const Certification found = certified(*robot_, {scene, {}, {}}, motion);
    ShapeObstacles obstacles;
    obstacles.scene = std::make_shared<const Scene>(scene);
    const ShapeCollider collider(robot_->description(), obstacles, {});
    if (const auto& witness = found.witness) {
      ++refuted;
      EXPECT_LE(clearance_m(collider, configuration(motion, witness->time_s)), 2e-5) << k;
      continue;
    }
    ASSERT_EQ(found.broken_limit, "") << k;
    proven += found.outcome == Outcome::kProven ? 1 : 0;
    undecided += found.outcome == Outcome::kUndecided ? 1 : 0;
    for (int i = 0; i <= 400 && found.outcome == Outcome::kProven; ++i) {
      EXPECT_GT(clearance_m(collider, configuration(motion, 5.0 * i / 400)), -1e-6) << k;
    }
  }
  EXPECT_GT(proven, 10);
  EXPECT_GT(refuted, 10);
  EXPECT_EQ(undecided, 0);
}

/// A ball at the end of an arm swings past another one, at a distance that is known.
class Swing {
 public:
  Swing(std::mt19937_64& random, double gap_m) {
    const auto draw = [&](double lower, double upper) {
      return std::uniform_real_distribution(lower, upper)(random);
    };
    const double arm_m = draw(0.2, 2.0), ball_m = draw(0.02, 0.15), other_m = draw(0.02, 0.3);
    const double at_rad = draw(-2.0, 2.0), away_m = arm_m + ball_m + other_m + gap_m;
    robot = crane(ball_m);
    scene = Scene({object("ball", Sphere{other_m},
                          {away_m * std::cos(at_rad), away_m * std::sin(at_rad), 0.0})});
    // In 0.1 to 10 s, wherever in the motion that is.
    motion = straight({{at_rad - draw(0.01, 1.5), arm_m}, {at_rad + draw(0.01, 1.5), arm_m}},
                      std::pow(10.0, draw(-1.0, 1.0)));
    // Straight, or by a cubic or a quintic from rest to rest.
    auto& [a0, a1, a2, a3, a4, a5] = motion.pieces[0].coefficients[0];
    const double h = motion.duration_s(), way = a1 * h, kind = draw(0.0, 3.0);
    if (kind > 1.0) a1 = 0.0;
    if (kind > 2.0) {
      a3 = 10.0 * way / std::pow(h, 3);
      a4 = -15.0 * way / std::pow(h, 4);
      a5 = 6.0 * way / std::pow(h, 5);
    } else if (kind > 1.0) {
      a2 = 3.0 * way / std::pow(h, 2);
      a3 = -2.0 * way / std::pow(h, 3);
    }
  }
  std::shared_ptr<const KinematicTree> robot;
  Scene scene;
  PolynomialMotion motion;
};

TEST(Certificates, NeverProveAGraze) {
  std::mt19937_64 random(5);
  int refuted = 0;
  constexpr int kCount = 10000;
  for (int k = 0; k < kCount; ++k) {
    const double depth_m = std::pow(10.0, std::uniform_real_distribution(-5.0, -2.0)(random));
    const Swing swing(random, -depth_m);
    const Certification found = certified(*swing.robot, {swing.scene, {}}, swing.motion);
    ASSERT_NE(found.outcome, Outcome::kProven) << k << ": " << depth_m;
    if (found.outcome == Outcome::kRefuted) ++refuted;
  }
  EXPECT_GT(refuted, 0.99 * kCount);
}

TEST(Certificates, ProveAGap) {
  std::mt19937_64 random(6);
  for (const double gap_m : {1e-4, 1e-3, 1e-2}) {
    int proven = 0;
    constexpr int kCount = 3333;
    for (int k = 0; k < kCount; ++k) {
      const Swing swing(random, gap_m);
      const Certification found = certified(*swing.robot, {swing.scene, {}}, swing.motion);
      ASSERT_NE(found.outcome, Outcome::kRefuted) << k << ": " << gap_m;
      if (found.outcome == Outcome::kProven) ++proven;
    }
    EXPECT_GT(proven, 0.99 * kCount) << gap_m;
  }
}

TEST(Certificates, KeepTheMargin) {
  std::mt19937_64 random(7);
  for (int k = 0; k < 300; ++k) {
    const Swing swing(random, 0.01);
    EXPECT_EQ(
        certified(*swing.robot, {swing.scene, {}}, swing.motion, {.margin_m = 0.0099}).outcome,
        Outcome::kProven);
    const auto found =
        certified(*swing.robot, {swing.scene, {}}, swing.motion, {.margin_m = 0.0101});
    ASSERT_EQ(found.outcome, Outcome::kRefuted);
    EXPECT_NEAR(found.witness->distance_m, 0.01, 1.1e-4);
    EXPECT_NEAR((found.witness->p_a - found.witness->p_b).norm(), found.witness->distance_m, 1e-9);
  }
}

TEST(Certificates, NameALimitThatIsBrokenBetweenWaypoints) {
  const auto robot = crane(0.05);
  PolynomialMotion motion;
  motion.pieces = {{0.0, 2.0, {{3.9, 0.4, -0.2}, {0.5}}}};  // 4.1 at 1 s, 3.9 at both ends
  EXPECT_THAT(certified(*robot, {}, motion).broken_limit,
              HasSubstr("turn breaks its upper limit of 4 at 1.0000 s: it is 4.1"));
  motion.pieces[0].coefficients[0] = {3.7, 0.4, -0.2};
  EXPECT_EQ(certified(*robot, {}, motion).outcome, Outcome::kProven);
}

TEST(Certificates, AreOfNothingThatMovesOrHasNoShapes) {
  const auto robot = crane(0.05);
  const auto motion = straight({{0.0, 0.5}, {0.5, 0.5}});
  SceneObject walker = object("walker", Sphere{0.1}, {2.0, 0.0, 0.0});
  walker.waypoints.push_back({1.0, Transform::Identity()});
  const auto moving = certify(*robot, {Scene({walker}), {}, {}}, motion, {});
  ASSERT_FALSE(moving);
  EXPECT_THAT(moving.error().describe(), HasSubstr("walker: it moves"));
  const auto far =
      certify(*robot, {Scene({object("far", Sphere{0.1}, {1500.0, 0, 0})})}, motion, {});
  ASSERT_FALSE(far);
  EXPECT_THAT(far.error().describe(), HasSubstr("far: reaches beyond 500 m"));
}

TEST(Certificates, NameLimitsInBothDirections) {
  const auto robot = crane(0.05);
  PolynomialMotion motion;
  motion.pieces = {{0.0, 2.0, {{-3.9, -0.4, 0.2}, {0.5}}}};  // -4.1 at 1 s, -3.9 at both ends
  EXPECT_THAT(certified(*robot, {}, motion).broken_limit, HasSubstr("turn breaks its lower limit"));
  motion.has_times = true;
  for (const double speed : {101.0, -101.0}) {
    motion.pieces = {{0.0, 0.01, {{0.0, speed}, {0.5}}}};  // 100 rad/s is the limit
    const Certification found = certified(*robot, {}, motion);
    EXPECT_EQ(found.outcome, Outcome::kRefuted);
    EXPECT_THAT(found.broken_limit, HasSubstr("turn breaks its velocity limit"));
  }
  motion.pieces = {{0.0, 0.01, {{0.0, -99.0}, {0.5}}}};
  EXPECT_EQ(certified(*robot, {}, motion).outcome, Outcome::kProven);
  motion.has_times = false;
  motion.pieces = {{0.0, 0.01, {{0.0, 101.0}, {0.5}}}};
  EXPECT_EQ(certified(*robot, {}, motion).outcome, Outcome::kProven);
}

TEST(Certificates, AreOfMotionsThatAreWhole) {
  const auto robot = crane(0.05);
  const decltype(PolynomialPiece::coefficients) still{{0.0}, {0.5}};
  const auto why = [&](const std::vector<PolynomialPiece>& pieces) {
    PolynomialMotion motion;
    motion.pieces = pieces;
    const auto found = certify(*robot, {}, motion, {});
    return found ? "" : found.error().describe();
  };
  EXPECT_EQ(why({{0.0, 1.0, still}, {1.0, 2.0, still}}), "");
  EXPECT_THAT(why({}), HasSubstr("the motion is empty"));
  EXPECT_THAT(why({{0.0, 1.0, still}, {1.5, 2.0, still}}), HasSubstr("do not fit together"));
  EXPECT_THAT(why({{0.5, 1.0, still}}), HasSubstr("do not fit together"));
  EXPECT_THAT(why({{0.0, 0.0, still}}), HasSubstr("do not fit together"));
  EXPECT_THAT(why({{0.0, 1.0, {{0.0}}}}), HasSubstr("do not fit together"));
  EXPECT_THAT(why({{0.0, 1.0, {{0.0}, {0.5, 3000.0}}}}), HasSubstr("slide does not stay within"));
}

TEST(Certificates, AreOfShapesAndScenesThatAreWhole) {
  const auto motion = straight({{0.0, 0.5}, {0.5, 0.5}});
  const auto why = [&](const KinematicTree& robot, const CertifiedScene& scene) {
    const auto found = certify(robot, scene, motion, {});
    return found ? "" : found.error().describe();
  };
  const auto robot = crane(0.05);
  EXPECT_EQ(why(*robot, {Scene(), {{"sand", Swarm::Kind::kBalls, {{{3, 0, 0}, 0.1}}}}}), "");
  EXPECT_THAT(why(*robot, {Scene(), {{"sand", Swarm::Kind::kBalls, {}}}}),
              HasSubstr("sand is empty"));
  EXPECT_THAT(why(*robot, {Scene(), {{"sand", Swarm::Kind::kBalls, {{{600, 0, 0}, 0.1}}}}}),
              HasSubstr("sand: reaches beyond 500 m"));
  EXPECT_THAT(why(*robot, {Scene({object("wall", Box{{2e3, 1, 1}}, {0, 3, 0})})}),
              HasSubstr("wall: reaches beyond 500 m"));
  SceneObject walker = object("walker", Sphere{0.1}, {2.0, 0.0, 0.0});
  walker.person = 0;
  EXPECT_THAT(why(*robot, {Scene({walker})}), HasSubstr("walker: it moves, or is drawn"));
  People crowd;
  crowd.groups.emplace_back();
  EXPECT_THAT(why(*robot, {Scene({}, crowd)}), HasSubstr("people: it moves, or is drawn"));
  crowd.groups.clear();
  crowd.persons.emplace_back();
  EXPECT_THAT(why(*robot, {Scene({}, crowd)}), HasSubstr("people: it moves, or is drawn"));
  EXPECT_THAT(why(*crane_of({}), {}), HasSubstr("has no collision shapes"));
  EXPECT_THAT(why(*crane_of({{2, HalfSpace{}, Transform::Identity()}}), {}),
              HasSubstr("cannot be a half-space"));
  const auto mesh = std::make_shared<const Mesh>();
  EXPECT_THAT(why(*crane_of({{2, mesh, Transform::Identity()}}), {}),
              HasSubstr("a mesh of link tip has no triangles"));
}

/// Two triangles face each other: who goes between them is in their hull, and touches neither.
TEST(Certificates, GoBetweenTheTrianglesOfAMesh) {
  auto mesh = std::make_shared<Mesh>();
  mesh->vertices_m = {{0.4, -1, -1}, {0.9, -1, -1}, {0.6, -1, 1},
                      {0.4, 1, -1},  {0.9, 1, -1},  {0.6, 1, 1}};
  mesh->triangles = {{0, 1, 2}, {3, 4, 5}};
  const auto scene = [&] {
    return CertifiedScene{
        Scene({object("gate", std::shared_ptr<const Mesh>(std::make_shared<Mesh>(*mesh)), {})}),
        {}};
  };
  const PolynomialMotion through = straight({{-0.5, 0.6}, {0.5, 0.6}});
  EXPECT_EQ(certified(*crane(0.05), scene(), through).outcome, Outcome::kProven);
  mesh->triangles.push_back({0, 4, 5});  // across the gate
  const auto met = certified(*crane(0.05), scene(), through);
  ASSERT_EQ(met.outcome, Outcome::kRefuted);
  EXPECT_NEAR(met.witness->distance_m, 0.0, 1e-9);
  mesh->triangles.clear();
  const auto none = certify(*crane(0.05), scene(), through, {});
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().describe(), HasSubstr("the mesh of gate has no triangles"));
}

/// A ball that swings within a box touches none of its triangles; the box has an inside as long as
/// none of them is missing.
TEST(Certificates, KnowWhatIsInsideOfAClosedMesh) {
  Mesh mesh = triangulate(Box{{4.0, 4.0, 4.0}});
  const auto scene = [&] {
    return CertifiedScene{
        Scene({object("room", std::make_shared<const Mesh>(mesh), {0.1, 0.2, 0.3})}), {}};
  };
  const PolynomialMotion motion = straight({{-0.5, 0.6}, {0.5, 0.6}});
  const auto inside = certified(*crane(0.05), scene(), motion);
  ASSERT_EQ(inside.outcome, Outcome::kRefuted);
  EXPECT_NEAR(inside.witness->time_s, 0.0, 1e-9);
  for (Eigen::Vector3i& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_EQ(certified(*crane(0.05), scene(), motion).outcome, Outcome::kRefuted);
  // What the same corner is, need not be that to the last digit; a triangle may be none.
  Mesh soup;
  for (const Eigen::Vector3i& triangle : mesh.triangles) {
    for (const int vertex : triangle) {
      const double off = 1e-7 * static_cast<double>(soup.vertices_m.size() % 3);
      soup.vertices_m.emplace_back(mesh.vertices_m[idx(vertex)].array() + off);
    }
    const int last = static_cast<int>(soup.vertices_m.size());
    soup.triangles.emplace_back(last - 3, last - 2, last - 1);
  }
  soup.triangles.emplace_back(0, 0, 1);
  std::swap(mesh, soup);
  EXPECT_EQ(certified(*crane(0.05), scene(), motion).outcome, Outcome::kRefuted);
  std::swap(mesh, soup);
  // Two sides of one sheet are no inside.
  const std::vector<Eigen::Vector3i> once = mesh.triangles;
  for (const Eigen::Vector3i& t : once) mesh.triangles.emplace_back(t[1], t[0], t[2]);
  EXPECT_EQ(certified(*crane(0.05), scene(), motion).surfaces, std::vector<std::string>{"room"});
  mesh.triangles = once;
  mesh.triangles.pop_back();
  const auto open = certified(*crane(0.05), scene(), motion);
  EXPECT_EQ(open.outcome, Outcome::kProven);
  EXPECT_EQ(open.surfaces, std::vector<std::string>{"room"});
}

/// The cubes of a map, and balls about points, are held against a robot as one object; FCL has them
/// as objects of their own.
TEST_F(PandasCertificates, OfSwarmsAreThoseOfTheirMembers) {
  std::mt19937_64 random(11);
  const auto draw = [&](double lower, double upper) {
    return std::uniform_real_distribution(lower, upper)(random);
  };
  int proven = 0, refuted = 0;
  for (int k = 0; k < 40; ++k) {
    Swarm swarm{"map", k % 2 == 0 ? Swarm::Kind::kCubes : Swarm::Kind::kBalls, {}};
    std::vector<SceneObject> objects;
    for (int i = 0; i < 300; ++i) {
      const double bearing = draw(-3.1, 3.1), away = draw(0.4, 1.2), size_m = draw(0.01, 0.05);
      const Eigen::Vector3d p(away * std::cos(bearing), away * std::sin(bearing), draw(-0.2, 1.2));
      swarm.members.push_back({p, size_m});
      const Shape shape =
          k % 2 == 0 ? Shape(Box{Eigen::Vector3d::Constant(size_m)}) : Shape(Sphere{size_m});
      objects.push_back(object("o" + std::to_string(i), shape, p));
    }
    const std::vector<double> start{0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785};
    std::vector<double> end = start;
    for (double& q : end) q += draw(-1.0, 1.0);
    const PolynomialMotion motion = straight({start, end});
    const Certification as_one = certified(*robot_, {{}, {swarm}}, motion);
    const Certification one_by_one = certified(*robot_, {Scene(objects), {}, {}}, motion);
    EXPECT_EQ(as_one.outcome, one_by_one.outcome) << k;
    proven += as_one.outcome == Outcome::kProven ? 1 : 0;
    refuted += as_one.outcome == Outcome::kRefuted ? 1 : 0;
    ShapeObstacles obstacles;
    obstacles.scene = std::make_shared<const Scene>(objects);
    const ShapeCollider collider(robot_->description(), obstacles, {});
    if (const auto& witness = as_one.witness) {
      EXPECT_LE(clearance_m(collider, configuration(motion, witness->time_s)), 2e-5) << k;
    }
    for (int i = 0; i <= 100 && as_one.outcome == Outcome::kProven; ++i) {
      EXPECT_GT(clearance_m(collider, configuration(motion, i / 100.0)), -1e-6) << k;
    }
  }
  EXPECT_GT(proven, 5);
  EXPECT_GT(refuted, 5);
}

}  // namespace
}  // namespace sidestep
