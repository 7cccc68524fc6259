#include <benchmark/benchmark.h>

#include "conformance/robot_conformance.hpp"
#include "robot_testing.hpp"

namespace {

using namespace sidestep;

constexpr std::size_t kBatch = 64;

/// The HSR, 64 random configurations and room for the results.
struct Bench {
  Bench()
      : robot(loader.load_or_fail("{profile: hsr}")),
        q(conformance::random_configurations(robot->description(), kBatch, 1)),
        spheres(robot->description().spheres.size()),
        dof(robot->description().joints.size()),
        centres(kBatch * spheres),
        jacobians(kBatch * spheres * dof),
        gradients(kBatch * dof),
        poses(robot->description().links.size()) {}
  testing_robot::Loader loader;
  std::unique_ptr<KinematicTree> robot;
  std::vector<double> q;
  std::size_t spheres;
  std::size_t dof;
  std::vector<Eigen::Vector3d> centres;
  std::vector<Eigen::Vector3d> jacobians;
  std::vector<double> gradients;
  std::vector<Transform> poses;
  Scratch scratch;
};

void count(benchmark::State& state) {
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(kBatch));
}

void BM_HsrSphereCentres(benchmark::State& state) {
  Bench b;
  for (auto _ : state) {
    b.robot->sphere_centres(b.q, b.centres, b.scratch);
    benchmark::DoNotOptimize(b.centres.data());
  }
  count(state);
}
BENCHMARK(BM_HsrSphereCentres);

/// The reference: every link's pose, then each centre.
void BM_HsrSphereCentresByLinkPoses(benchmark::State& state) {
  Bench b;
  const auto& spheres = b.robot->description().spheres;
  for (auto _ : state) {
    for (std::size_t row = 0; row < kBatch; ++row) {
      b.robot->link_poses(std::span(b.q).subspan(row * b.dof, b.dof), b.poses, b.scratch);
      for (std::size_t s = 0; s < b.spheres; ++s) {
        b.centres[row * b.spheres + s] =
            b.poses[static_cast<std::size_t>(spheres[s].link)] * spheres[s].centre_link_m;
      }
    }
    benchmark::DoNotOptimize(b.centres.data());
  }
  count(state);
}
BENCHMARK(BM_HsrSphereCentresByLinkPoses);

void BM_HsrSphereJacobians(benchmark::State& state) {
  Bench b;
  for (auto _ : state) {
    b.robot->sphere_jacobians(b.q, b.centres, b.jacobians, b.scratch);
    benchmark::DoNotOptimize(b.jacobians.data());
  }
  count(state);
}
BENCHMARK(BM_HsrSphereJacobians);

/// As costs have them: a few spheres of each configuration.
std::vector<LinkForce> some_forces(Bench& b) {
  std::vector<LinkForce> forces;
  b.robot->sphere_centres(b.q, b.centres, b.scratch);
  const auto& spheres = b.robot->description().spheres;
  for (std::size_t i = 0; i < b.centres.size(); i += 5) {
    forces.push_back({static_cast<int>(i / spheres.size()), spheres[i % spheres.size()].link,
                      Eigen::Vector3d::UnitX(), b.centres[i].cross(Eigen::Vector3d::UnitX())});
  }
  return forces;
}

void BM_HsrPullBack(benchmark::State& state) {
  Bench b;
  const std::vector<LinkForce> forces = some_forces(b);
  std::vector<double> joint_forces(forces.size() * b.dof);
  for (auto _ : state) {
    b.robot->pull_back(b.q, forces, joint_forces, b.scratch);
    benchmark::DoNotOptimize(joint_forces.data());
  }
  count(state);
}
BENCHMARK(BM_HsrPullBack);

/// Where bodies have been placed already, for the centres of spheres.
void BM_HsrPullBackAlong(benchmark::State& state) {
  Bench b;
  const std::vector<LinkForce> forces = some_forces(b);
  std::vector<double> joint_forces(forces.size() * b.dof);
  Scratch::Scope scope(b.scratch);
  const auto axes = scope.array<float>(b.robot->axes_size(kBatch));
  const auto centres = scope.array<PointFloats>(float_groups(kBatch) * b.spheres);
  b.robot->sphere_centre_lanes(b.q, centres, axes, b.scratch);
  for (auto _ : state) {
    b.robot->pull_back_along(axes, forces, joint_forces, b.scratch);
    benchmark::DoNotOptimize(joint_forces.data());
  }
  count(state);
}
BENCHMARK(BM_HsrPullBackAlong);

}  // namespace
