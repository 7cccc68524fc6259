#include <atomic>
#include <cstdlib>
#include <new>

#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/problem.hpp>

#include "conformance/analytic_models.hpp"
#include "conformance/cost_conformance.hpp"

namespace {
std::atomic<int> allocations{0};

void* counted(std::size_t size, std::size_t alignment) {
  ++allocations;
  void* memory = std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
}  // namespace

void* operator new(std::size_t size) { return counted(size, alignof(std::max_align_t)); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return counted(size, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace sidestep {
namespace {

using namespace conformance;

TEST(StandardCosts, DoNotAllocateOnceTheScratchIsWarm) {
  Problem problem;
  problem.robot = std::make_shared<PlanarRobot>(PlanarRobot::Shape{4, true});
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0.3, 0.2, 0.0}, 0.4}});
  problem.start = {Eigen::VectorXd::Zero(6), Eigen::VectorXd::Zero(6)};
  problem.goal = {Eigen::VectorXd::Ones(6), Eigen::VectorXd::Zero(6)};
  const auto terms = standard_terms(problem, {});
  ASSERT_EQ(terms.size(), 6u);
  const States states = random_states(6, 200, 2.8, 3.0);
  for (const CostTerm& term : terms) {
    const auto rows = static_cast<std::size_t>(200 * term.cost->residual_count());
    std::vector<double> residuals(rows), by_q(6 * rows), by_qdot(6 * rows);
    Scratch scratch;
    term.cost->evaluate(states.batch(), {residuals, by_q, by_qdot}, scratch);
    const int before = allocations;
    term.cost->evaluate(states.batch(), {residuals, by_q, by_qdot}, scratch);
    EXPECT_EQ(allocations - before, 0) << term.cost->name();
    EXPECT_GT(Eigen::Map<const Eigen::VectorXd>(residuals.data(), residuals.size()).norm(), 0.0)
        << term.cost->name();
  }
}

}  // namespace
}  // namespace sidestep
