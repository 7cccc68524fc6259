#include "chain_system.hpp"

#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace sidestep {
namespace {

/// A random positive definite block tridiagonal system, dense.
struct DenseChain {
  Eigen::MatrixXd h;
  Eigen::VectorXd b;

  DenseChain(int states, int width) {
    std::mt19937 generator(5);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    const auto draw = [&] { return uniform(generator); };
    const int n = states * width;
    h = 0.1 * Eigen::MatrixXd::Identity(n, n);
    b = Eigen::VectorXd::NullaryExpr(n, draw);
    for (int i = 0; i + 1 < states; ++i) {  // rows that touch two neighbours only
      const Eigen::MatrixXd rows = Eigen::MatrixXd::NullaryExpr(width + 2, 2 * width, draw);
      h.block(i * width, i * width, 2 * width, 2 * width) += rows.transpose() * rows;
    }
  }

  void fill(ChainSystem& system, int states, int width) const {
    system.resize(states, width);
    for (int i = 0; i < states; ++i) {
      for (int j = 0; j < width; ++j) {
        const auto column = static_cast<std::size_t>(j) * system.stride();
        for (int r = j; r < width; ++r) {
          system.own_block(i)[column + static_cast<std::size_t>(r)] =
              h(i * width + r, i * width + j);
        }
        for (int r = 0; r < width && i + 1 < states; ++r) {
          system.coupling(i)[column + static_cast<std::size_t>(r)] =
              h((i + 1) * width + r, i * width + j);
        }
        system.rhs(i)[j] = b[i * width + j];
      }
    }
    system.seal();
  }
};

class ChainSystemTest : public testing::TestWithParam<std::pair<int, int>> {};

TEST_P(ChainSystemTest, SolvesAsADenseCholeskyDoesForOneDampingAfterAnother) {
  const auto [states, width] = GetParam();
  const DenseChain dense(states, width);
  ChainSystem system;
  dense.fill(system, states, width);
  Eigen::VectorXd x(states * width);
  for (const double lambda : {0.0, 10.0, 0.5}) {
    ASSERT_TRUE(system.solve(lambda, {x.data(), static_cast<std::size_t>(x.size())}));
    Eigen::MatrixXd damped = dense.h;
    damped.diagonal().array() += lambda;
    EXPECT_TRUE(x.isApprox(damped.llt().solve(dense.b), 1e-9)) << "lambda " << lambda;
  }
}

TEST_P(ChainSystemTest, EliminatesOnlyWhatHasChanged) {
  const auto [states, width] = GetParam();
  DenseChain dense(states, width);
  ChainSystem system;
  dense.fill(system, states, width);
  system.keep();
  Eigen::VectorXd x(states * width);
  const std::span<double> solved(x.data(), static_cast<std::size_t>(x.size()));
  const int last = states - 1;
  const auto put_rhs = [&] {
    for (int v = 0; v < states * width; ++v) system.rhs(v / width)[v % width] = dense.b[v];
    system.seal();
  };
  ASSERT_TRUE(system.solve(0.5, solved));
  Eigen::MatrixXd damped = dense.h;
  damped.diagonal().array() += 0.5;

  system.clear(last);
  dense.b.tail(width) *= -3.0;
  dense.h.bottomRightCorner(width, width).diagonal().array() += 2.0;
  for (int j = 0; j < width; ++j) {
    const auto column = static_cast<std::size_t>(j) * system.stride();
    system.own_block(last)[column + static_cast<std::size_t>(j)] += 2.0;
  }
  damped.bottomRightCorner(width, width).diagonal().array() += 2.0;
  put_rhs();
  ASSERT_TRUE(system.solve(0.5, solved));
  EXPECT_TRUE(x.isApprox(damped.llt().solve(dense.b), 1e-9)) << "from the last state on";

  damped.diagonal().array() -= 0.5;
  ASSERT_TRUE(system.solve(0.0, solved));
  EXPECT_TRUE(x.isApprox(damped.llt().solve(dense.b), 1e-9)) << "another lambda";
}

TEST_P(ChainSystemTest, MultipliesAsADenseMatrixDoes) {
  const auto [states, width] = GetParam();
  const DenseChain dense(states, width);
  ChainSystem system;
  dense.fill(system, states, width);
  Eigen::VectorXd out(states * width);
  const auto n = static_cast<std::size_t>(out.size());
  system.product({dense.b.data(), n}, {out.data(), n});
  EXPECT_TRUE(out.isApprox(dense.h * dense.b, 1e-12));
}

TEST_P(ChainSystemTest, HoldsAStateStill) {
  const auto [states, width] = GetParam();
  const DenseChain dense(states, width);
  ChainSystem system;
  dense.fill(system, states, width);
  system.hold(states - 1);
  system.seal();
  Eigen::VectorXd x(states * width);
  ASSERT_TRUE(system.solve(0.0, {x.data(), static_cast<std::size_t>(x.size())}));
  const int free = (states - 1) * width;
  EXPECT_TRUE(x.tail(width).isZero(0.0));
  EXPECT_TRUE(x.head(free).isApprox(
      dense.h.topLeftCorner(free, free).llt().solve(dense.b.head(free)), 1e-9));
}

TEST_P(ChainSystemTest, SaysWhereItIsNotPositiveDefinite) {
  const auto [states, width] = GetParam();
  DenseChain dense(states, width);
  dense.h(states * width - 1, states * width - 1) = -1.0;
  ChainSystem system;
  dense.fill(system, states, width);
  std::vector<double> x(static_cast<std::size_t>(states * width));
  EXPECT_FALSE(system.solve(0.0, x));
  EXPECT_TRUE(system.solve(1e3, x));
}

INSTANTIATE_TEST_SUITE_P(Sizes, ChainSystemTest,
                         testing::Values(std::pair{2, 2}, std::pair{3, 4}, std::pair{5, 6},
                                         std::pair{11, 14}, std::pair{7, 16}, std::pair{4, 30}));

}  // namespace
}  // namespace sidestep
