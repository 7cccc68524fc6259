#include "chain_system.hpp"

#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace sidestep {
namespace {

/// A chain whose joints are coupled with each other in the intervals from `first` to `last` - 1
/// only.
struct ChainShape {
  int states;
  int width;
  int first;
  int last;
};

ChainShape coupled_throughout(int states, int width) { return {states, width, 0, states - 1}; }

/// A random positive definite block tridiagonal system, dense.
struct DenseChain {
  Eigen::MatrixXd h;
  Eigen::VectorXd b;

  explicit DenseChain(const ChainShape& shape) {
    const auto [states, width, first, last] = shape;
    std::mt19937 generator(5);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    const auto draw = [&] { return uniform(generator); };
    const int n = states * width;
    h = 0.1 * Eigen::MatrixXd::Identity(n, n);
    b = Eigen::VectorXd::NullaryExpr(n, draw);
    for (int i = 0; i + 1 < states; ++i) {  // rows that touch two neighbours only
      Eigen::MatrixXd rows = Eigen::MatrixXd::NullaryExpr(2 * width, 2 * width, draw);
      for (Eigen::Index row = 0; row < rows.rows() && (i < first || i >= last); ++row) {
        for (Eigen::Index v = 0; v < rows.cols(); ++v) {  // and but one joint
          if (v % (width / 2) != row % (width / 2)) rows(row, v) = 0.0;
        }
      }
      h.block(i * width, i * width, 2 * width, 2 * width) += rows.transpose() * rows;
    }
  }

  void fill(ChainSystem& system, const ChainShape& shape) const {
    const int states = shape.states, width = shape.width;
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

class ChainSystemTest : public testing::TestWithParam<ChainShape> {};

TEST_P(ChainSystemTest, SolvesAsADenseCholeskyDoesForOneDampingAfterAnother) {
  const int states = GetParam().states, width = GetParam().width;
  const DenseChain dense(GetParam());
  ChainSystem system;
  dense.fill(system, GetParam());
  Eigen::VectorXd x(states * width);
  for (const double lambda : {0.0, 10.0, 0.5}) {
    ASSERT_TRUE(system.solve(lambda, {x.data(), static_cast<std::size_t>(x.size())}));
    Eigen::MatrixXd damped = dense.h;
    damped.diagonal().array() += lambda;
    EXPECT_TRUE(x.isApprox(damped.llt().solve(dense.b), 1e-9)) << "lambda " << lambda;
  }
}

TEST_P(ChainSystemTest, EliminatesOnlyWhatHasChanged) {
  const int states = GetParam().states, width = GetParam().width;
  DenseChain dense(GetParam());
  ChainSystem system;
  dense.fill(system, GetParam());
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
  const int states = GetParam().states, width = GetParam().width;
  const DenseChain dense(GetParam());
  ChainSystem system;
  dense.fill(system, GetParam());
  Eigen::VectorXd out(states * width);
  const auto n = static_cast<std::size_t>(out.size());
  system.product({dense.b.data(), n}, {out.data(), n});
  EXPECT_TRUE(out.isApprox(dense.h * dense.b, 1e-12));
}

TEST_P(ChainSystemTest, HoldsAStateStill) {
  const int states = GetParam().states, width = GetParam().width;
  const DenseChain dense(GetParam());
  ChainSystem system;
  dense.fill(system, GetParam());
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
  const int states = GetParam().states, width = GetParam().width;
  DenseChain dense(GetParam());
  dense.h(states * width - 1, states * width - 1) = -1.0;
  ChainSystem system;
  dense.fill(system, GetParam());
  std::vector<double> x(static_cast<std::size_t>(states * width));
  EXPECT_FALSE(system.solve(0.0, x));
  EXPECT_TRUE(system.solve(1e3, x));
}

TEST_P(ChainSystemTest, SolvesWhereJointsBecomeCoupledAndAreNoLonger) {
  const int states = GetParam().states, width = GetParam().width;
  const DenseChain dense(GetParam());
  ChainSystem system;
  dense.fill(system, GetParam());
  system.keep();
  Eigen::VectorXd x(states * width);
  for (const int coupled : {states - 1, states / 2, 0, -1}) {
    Eigen::MatrixXd h = dense.h;
    system.clear();
    for (int j = 0; j < width && coupled >= 0; ++j) {  // the sum of all that moves, squared
      const auto column = static_cast<std::size_t>(j) * system.stride();
      for (int r = j; r < width; ++r) {
        system.own_block(coupled)[column + static_cast<std::size_t>(r)] += 1.0;
      }
    }
    if (coupled >= 0) h.block(coupled * width, coupled * width, width, width).array() += 1.0;
    for (int v = 0; v < states * width; ++v) system.rhs(v / width)[v % width] = dense.b[v];
    system.seal();
    ASSERT_TRUE(system.solve(0.0, {x.data(), static_cast<std::size_t>(x.size())}));
    EXPECT_TRUE(x.isApprox(h.llt().solve(dense.b), 1e-9)) << "state " << coupled;
  }
}

TEST_P(ChainSystemTest, SpreadsNormalNumbersAsTheInverseHasThem) {
  const int states = GetParam().states, width = GetParam().width;
  const DenseChain dense(GetParam());
  ChainSystem system;
  dense.fill(system, GetParam());
  const Eigen::Index n = states * width;
  Eigen::VectorXd x(n);
  ASSERT_TRUE(system.solve(0.5, {x.data(), static_cast<std::size_t>(n)}));
  Eigen::MatrixXd spread = Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index v = 0; v < n; ++v) {
    system.spread({spread.col(v).data(), static_cast<std::size_t>(n)});
  }
  Eigen::MatrixXd damped = dense.h;
  damped.diagonal().array() += 0.5;
  // Samples are spread * normal numbers, their covariance is spread * spread^T.
  EXPECT_TRUE((damped * spread * spread.transpose()).isIdentity(1e-8));
}

INSTANTIATE_TEST_SUITE_P(CoupledThroughout, ChainSystemTest,
                         testing::Values(coupled_throughout(2, 2), coupled_throughout(3, 4),
                                         coupled_throughout(5, 6), coupled_throughout(11, 14),
                                         coupled_throughout(7, 16), coupled_throughout(4, 30)));
INSTANTIATE_TEST_SUITE_P(CoupledInPart, ChainSystemTest,
                         testing::Values(ChainShape{11, 14, 3, 5}, ChainShape{11, 14, 0, 2},
                                         ChainShape{11, 14, 8, 10}, ChainShape{11, 14, 9, 10},
                                         ChainShape{11, 14, 0, 0}, ChainShape{2, 14, 0, 0},
                                         ChainShape{7, 16, 5, 6}, ChainShape{9, 18, 3, 5},
                                         ChainShape{6, 30, 2, 3}));

}  // namespace
}  // namespace sidestep
