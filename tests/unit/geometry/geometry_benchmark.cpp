#include <benchmark/benchmark.h>

#include <sidestep/geometry/ray_caster.hpp>

#include "geometry_testing.hpp"

namespace sidestep {
namespace {

Mesh ten_thousand_triangles() { return triangulate(Capsule{0.2, 0.6}, 100); }

void mesh_distance(benchmark::State& state, const Shape& mesh) {
  std::mt19937 random(1);
  for (auto _ : state) {
    benchmark::DoNotOptimize(signed_distance_m(mesh, testing::uniform_point(random, 0.7)));
  }
}
void BM_MeshDistanceIndexed(benchmark::State& state) {
  mesh_distance(state, indexed_mesh(ten_thousand_triangles()));
}
BENCHMARK(BM_MeshDistanceIndexed)->Unit(benchmark::kMicrosecond);

void BM_MeshDistanceBruteForce(benchmark::State& state) {
  mesh_distance(state, std::make_shared<const Mesh>(ten_thousand_triangles()));
}
BENCHMARK(BM_MeshDistanceBruteForce)->Unit(benchmark::kMicrosecond);

/// Rays from one point into a cloud of boxes and balls.
void BM_CastRays(benchmark::State& state) {
  std::mt19937 random(2);
  std::vector<SceneObject> objects;
  for (int i = 0; i < 50; ++i) {
    SceneObject object;
    if (i % 2 == 0) {
      object.shape = Box{{0.3, 0.4, 0.5}};
    } else {
      object.shape = Sphere{0.3};
    }
    object.waypoints = {{0.0, transform_from_xyz_rpy(testing::uniform_point(random, 3.0),
                                                     testing::uniform_point(random, 3.0))}};
    objects.push_back(std::move(object));
  }
  const RayCaster caster{Scene(std::move(objects))};
  constexpr int kRays = 1000;
  const std::vector<Eigen::Vector3d> origins(kRays, Eigen::Vector3d::Zero());
  std::vector<Eigen::Vector3d> directions;
  for (int i = 0; i < kRays; ++i) directions.push_back(testing::uniform_direction(random));
  std::vector<RayHit> hits(kRays);
  for (auto _ : state) {
    caster.cast(origins, directions, hits);
    benchmark::DoNotOptimize(hits.data());
  }
  state.SetItemsProcessed(state.iterations() * kRays);
}
BENCHMARK(BM_CastRays)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace sidestep
