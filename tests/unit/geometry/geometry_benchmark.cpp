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

/// A cloud of boxes and balls, and rays from its middle, row by row as a camera's.
struct CastRays {
  static constexpr int kSide = 64;
  Scene scene;
  std::vector<Eigen::Vector3d> directions;

  CastRays() {
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
    scene = Scene(std::move(objects));
    for (int v = 0; v < kSide; ++v) {
      for (int u = 0; u < kSide; ++u) {
        directions.push_back(
            Eigen::Vector3d(1.0, 2.0 * u / kSide - 1.0, 2.0 * v / kSide - 1.0).normalized());
      }
    }
  }
};

void BM_CastRays(benchmark::State& state) {
  const CastRays rays;
  const RayCaster caster(rays.scene);
  const std::vector<Eigen::Vector3d> origins(rays.directions.size(), Eigen::Vector3d::Zero());
  std::vector<RayHit> hits(rays.directions.size());
  for (auto _ : state) {
    caster.cast(origins, rays.directions, hits);
    benchmark::DoNotOptimize(hits.data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(hits.size()));
}
BENCHMARK(BM_CastRays)->Unit(benchmark::kMicrosecond);

void BM_CastDistances(benchmark::State& state) {
  const CastRays rays;
  const RayCaster caster(rays.scene);
  std::vector<double> distances_m(rays.directions.size());
  for (auto _ : state) {
    caster.cast_distances(Eigen::Vector3d::Zero(), rays.directions, distances_m);
    benchmark::DoNotOptimize(distances_m.data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(distances_m.size()));
}
BENCHMARK(BM_CastDistances)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace sidestep
