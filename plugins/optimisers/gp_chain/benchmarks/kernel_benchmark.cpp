// The kernels of an iteration, each beside the plain way to the same result: the HSR on its way to
// a table, 96 states.
#include <random>

#include <benchmark/benchmark.h>
#include <Eigen/SparseCholesky>

#include <sidestep/planning/state_normals.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

#include "chain_system.hpp"
#include "support/hsr_table.hpp"

namespace sidestep {
namespace {

using namespace testing_support;

/// States on the way from start to goal, and where the robot's spheres are there.
struct Way {
  Problem problem = hsr_reaches_table(20, 4);
  int count = 96;
  std::vector<double> q, qdot, times_s;
  std::vector<PointFloats> centres_m;
  std::vector<double> limits_m;
  Scratch scratch;

  Way() {
    const RobotDescription& robot = problem.robot->description();
    for (int i = 0; i < count; ++i) {
      const double share = i / (count - 1.0);
      for (int j = 0; j < robot.dof(); ++j) {
        q.push_back((1.0 - share) * problem.start.q[j] + share * problem.goal.q[j]);
      }
      times_s.push_back(share);
    }
    qdot.assign(q.size(), 0.1);
    const std::size_t groups = float_groups(times_s.size());
    centres_m.resize(groups * robot.spheres.size());
    const auto& tree = dynamic_cast<const KinematicTree&>(*problem.robot);
    Scratch::Scope scope(scratch);
    const auto axes = scope.array<float>(tree.axes_size(times_s.size()));
    tree.sphere_centre_lanes(q, centres_m, axes, scratch);
    for (std::size_t g = 0; g < groups; ++g) {
      for (const CollisionSphere& sphere : robot.spheres) {
        limits_m.push_back(0.2 + sphere.radius_m);
      }
    }
  }

  [[nodiscard]] StateBatch states() const {
    return {count, problem.robot->description().dof(), q, qdot, times_s};
  }
};

/// The spheres that are near to obstacles.
void query_below(benchmark::State& state) {
  const Way way;
  std::vector<FieldSample> samples(way.centres_m.size() * kFloatLanes);
  std::size_t found = 0;
  for (auto _ : state) {
    found = way.problem.field->query_below(way.centres_m, way.limits_m, false, samples);
    benchmark::DoNotOptimize(samples.data());
  }
  state.counters["found"] = static_cast<double>(found);
}
BENCHMARK(query_below)->Unit(benchmark::kMicrosecond);

void query_below_by_querying_all(benchmark::State& state) {
  const Way way;
  std::vector<Eigen::Vector3d> points_m;
  for (const PointFloats& group : way.centres_m) {
    for (std::size_t lane = 0; lane < kFloatLanes; ++lane) {
      points_m.emplace_back(group.x[lane], group.y[lane], group.z[lane]);
    }
  }
  std::vector<double> distances_m(points_m.size());
  std::vector<Eigen::Vector3d> gradients(points_m.size());
  std::vector<FieldStatus> statuses(points_m.size());
  std::size_t found = 0;
  for (auto _ : state) {
    way.problem.field->query(points_m, distances_m, gradients, statuses);
    found = 0;
    for (std::size_t i = 0; i < points_m.size(); ++i) {
      found += distances_m[i] < way.limits_m[i / kFloatLanes] ? 1 : 0;
    }
    benchmark::DoNotOptimize(found);
  }
  state.counters["found"] = static_cast<double>(found);
}
BENCHMARK(query_below_by_querying_all)->Unit(benchmark::kMicrosecond);

/// Normal equations of a cost from its residuals and Jacobians, as every cost has them by default.
void linearise_plainly(const StateCost& cost, const Way& way, StateNormals& normals,
                       Scratch& scratch) {
  benchmark::DoNotOptimize(cost.StateCost::linearise(way.states(), {0, 1}, normals, scratch));
}

void linearise_as_it_does(const StateCost& cost, const Way& way, StateNormals& normals,
                          Scratch& scratch) {
  benchmark::DoNotOptimize(cost.linearise(way.states(), {0, 1}, normals, scratch));
}

void linearise(benchmark::State& state, std::string_view name, decltype(linearise_plainly)* one) {
  Way way;
  StateNormals normals;
  normals.resize(way.count, way.states().dof);
  for (const CostTerm& term : way.problem.terms) {
    if (term.cost->name() != name) continue;
    for (auto _ : state) {
      normals.clear();
      one(*term.cost, way, normals, way.scratch);
    }
  }
}
BENCHMARK_CAPTURE(linearise, obstacle, "obstacle", linearise_as_it_does)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(linearise, obstacle_plainly, "obstacle", linearise_plainly)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(linearise, self_collision, "self_collision", linearise_as_it_does)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(linearise, self_collision_plainly, "self_collision", linearise_plainly)
    ->Unit(benchmark::kMicrosecond);

/// A chain of 20 states with 16 variables each, and the same as a sparse matrix. Joints are coupled
/// with each other in the states from `first` to `last` - 1 only.
struct Chain {
  static constexpr int kStates = 20;
  static constexpr int kWidth = 16;
  static constexpr int kDof = kWidth / 2;
  ChainSystem system;
  Eigen::SparseMatrix<double> H;
  Eigen::VectorXd b;

  explicit Chain(int first = 0, int last = kStates) {
    std::mt19937 generator(4);
    std::normal_distribution<double> normal;
    system.resize(kStates, kWidth);
    system.clear();
    std::vector<Eigen::Triplet<double>> entries;
    b.resize(kStates * kWidth);
    for (int i = 0; i < kStates; ++i) {
      for (int c = 0; c < kWidth; ++c) {
        double* own = system.own_block(i) + static_cast<std::size_t>(c) * system.stride();
        double* next = system.coupling(i) + static_cast<std::size_t>(c) * system.stride();
        for (int r = 0; r < kWidth; ++r) {
          if (r % kDof != c % kDof && (i < first || i >= last)) continue;
          if (r >= c) {
            own[r] = normal(generator) + (r == c ? 100.0 : 0.0);
            entries.emplace_back(i * kWidth + r, i * kWidth + c, own[r]);
          }
          if (i + 1 == kStates) continue;
          next[r] = normal(generator);
          entries.emplace_back((i + 1) * kWidth + r, i * kWidth + c, next[r]);
        }
        b[i * kWidth + c] = system.rhs(i)[c] = normal(generator);
      }
    }
    system.seal();
    H.resize(b.size(), b.size());
    H.setFromTriplets(entries.begin(), entries.end());
  }
};

void solve(benchmark::State& state, Chain chain) {
  std::vector<double> x(static_cast<std::size_t>(chain.b.size()));
  double lambda = 0.1;
  for (auto _ : state) {
    lambda = 0.3 - lambda;  // another one each time: with the same its factor would be kept
    if (!chain.system.solve(lambda, x)) state.SkipWithError("not positive definite");
    benchmark::DoNotOptimize(x.data());
  }
}
void solve_chain(benchmark::State& state) { solve(state, Chain()); }
BENCHMARK(solve_chain)->Unit(benchmark::kMicrosecond);

/// As where an obstacle is near at five states in the middle.
void solve_chain_coupled_in_part(benchmark::State& state) { solve(state, Chain(8, 13)); }
BENCHMARK(solve_chain_coupled_in_part)->Unit(benchmark::kMicrosecond);

/// The pattern is analysed once.
void solve_chain_as_sparse_matrix(benchmark::State& state) {
  Chain chain;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>>
      solver;
  solver.analyzePattern(chain.H);
  Eigen::VectorXd x;
  for (auto _ : state) {
    solver.factorize(chain.H);
    x = solver.solve(chain.b);
    benchmark::DoNotOptimize(x.data());
  }
}
BENCHMARK(solve_chain_as_sparse_matrix)->Unit(benchmark::kMicrosecond);

void solve_chain_as_dense_matrix(benchmark::State& state) {
  Chain chain;
  const Eigen::MatrixXd H = chain.H;
  Eigen::VectorXd x;
  for (auto _ : state) {
    x = H.selfadjointView<Eigen::Lower>().llt().solve(chain.b);
    benchmark::DoNotOptimize(x.data());
  }
}
BENCHMARK(solve_chain_as_dense_matrix)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace sidestep
