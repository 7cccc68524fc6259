#include <random>

#include <gtest/gtest.h>

#include <sidestep/certificates/body.hpp>
#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// A body beside the origin, so that no mistake of a sign is symmetric, and all of its corners or
/// members.
class BodyTest : public ::testing::Test {
 protected:
  Eigen::Vector3d draw(double lower, double upper) {
    std::uniform_real_distribution<double> of(lower, upper);
    return {of(random_), of(random_), of(random_)};
  }
  Mesh mesh() {
    Mesh made;
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector3d corner = Eigen::Vector3d(3.0, -2.0, 1.0) + draw(-1.0, 1.0);
      for (int k = 0; k < 3; ++k) made.vertices_m.emplace_back(corner + draw(-0.1, 0.1));
      made.triangles.emplace_back(3 * i, 3 * i + 1, 3 * i + 2);
    }
    return made;
  }
  Swarm swarm(Swarm::Kind kind) {
    Swarm made{"map", kind, {}};
    for (int i = 0; i < 77; ++i) {
      made.members.push_back({Eigen::Vector3d(-2.0, 3.0, 1.0) + draw(-1.0, 1.0), 0.01 + 0.001 * i});
    }
    return made;
  }
  /// How far an item reaches along a direction of length 1.
  static double reach_m(const Swarm::Member& member, Swarm::Kind kind, const Eigen::Vector3d& n) {
    const double beyond_m = kind == Swarm::Kind::kBalls
                                ? member.size_m
                                : 0.5 * member.size_m * n.cwiseAbs().sum();  // of a cube's corner
    return n.dot(member.centre_m) + beyond_m;
  }
  /// Every share, from all items to each alone, against all of its items.
  template <class Reach>
  void expect_farthest(const Body& body, const Share& share, const Reach& reach_of_item) {
    for (int i = 0; i < 10; ++i) {
      const Eigen::Vector3d n = draw(-1.0, 1.0).normalized();
      double most_m = -std::numeric_limits<double>::infinity();
      for (std::size_t item = share.first; item < share.last; ++item) {
        most_m = std::max(most_m, reach_of_item(item, n));
      }
      ASSERT_NEAR(n.dot(body.farthest(share, n)), most_m, 1e-12);
    }
    if (share.is_single()) return;
    for (const Share& half : share.halves()) expect_farthest(body, half, reach_of_item);
  }

  std::mt19937 random_{7};
};

TEST_F(BodyTest, TheFarthestPointOfSharesIsThatOfAllTheirItems) {
  const auto made = std::make_shared<const Mesh>(mesh());
  const Body of_mesh{Shape(made)};
  expect_farthest(of_mesh, of_mesh.all(), [&](std::size_t item, const Eigen::Vector3d& n) {
    double most_m = -std::numeric_limits<double>::infinity();
    for (const int vertex : of_mesh.triangles()[item]) {
      most_m = std::max(most_m, n.dot(made->vertices_m[idx(vertex)]));
    }
    return most_m;
  });
  for (const auto kind : {Swarm::Kind::kCubes, Swarm::Kind::kBalls}) {
    const Body of_swarm(swarm(kind));
    expect_farthest(of_swarm, of_swarm.all(), [&](std::size_t item, const Eigen::Vector3d& n) {
      return reach_m(of_swarm.members()[item], kind, n);
    });
  }
}

TEST_F(BodyTest, MayHoldWhatIsInItsBoundingBox) {
  const Swarm cubes = swarm(Swarm::Kind::kCubes);
  const Body body(cubes);
  Eigen::AlignedBox3d box;
  for (const Swarm::Member& member : cubes.members) {
    const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5 * member.size_m);
    box.extend(member.centre_m - half).extend(member.centre_m + half);
  }
  const Share all = body.all();
  EXPECT_LT((body.centre(all) - box.center()).norm(), 1e-12);
  EXPECT_NEAR(body.extent_m(all), 0.5 * box.sizes().norm(), 1e-12);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d p = box.center() + draw(-1.5, 1.5);
    EXPECT_EQ(body.may_hold(p), box.contains(p)) << p.transpose();
  }
}

}  // namespace
}  // namespace sidestep
