#pragma once

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/planning/state_cost.hpp>
#include <sidestep/planning/state_normals.hpp>

/// What every StateCost must hold. Call expect_conforms(cost, states) from a test of your own.
namespace sidestep::conformance {

/// States that own their values.
struct States {
  int dof = 0;
  std::vector<double> q, qdot, times_s;

  [[nodiscard]] int count() const { return static_cast<int>(times_s.size()); }
  [[nodiscard]] StateBatch batch() const { return {count(), dof, q, qdot, times_s}; }
  [[nodiscard]] States one(int i) const {
    const auto row = [&](const std::vector<double>& values) {
      return std::vector<double>(values.begin() + i * dof, values.begin() + (i + 1) * dof);
    };
    return {dof, row(q), row(qdot), {times_s[static_cast<std::size_t>(i)]}};
  }
};

/// `count` states with positions uniform in +-q_range and velocities in +-qdot_range.
[[nodiscard]] inline States random_states(int dof, int count, double q_range, double qdot_range,
                                          unsigned seed = 1) {
  std::mt19937 generator(seed);
  const auto draw = [&](double range) {
    std::uniform_real_distribution<double> uniform(-range, range);
    std::vector<double> values(static_cast<std::size_t>(count * dof));
    for (double& value : values) value = uniform(generator);
    return values;
  };
  States states{dof, draw(q_range), draw(qdot_range), {}};
  for (int i = 0; i < count; ++i) states.times_s.push_back(0.1 * i);
  return states;
}

/// Everything that a cost computes for a batch; NaN where it wrote nothing.
struct Evaluation {
  std::vector<double> residuals, jacobian_q, jacobian_qdot;
};

[[nodiscard]] inline Evaluation evaluate(const StateCost& cost, const States& states,
                                         bool jacobians = true) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto rows = static_cast<std::size_t>(states.count() * cost.residual_count());
  const std::size_t entries = jacobians ? rows * static_cast<std::size_t>(states.dof) : 0;
  Evaluation out{std::vector<double>(rows, nan), std::vector<double>(entries, nan),
                 std::vector<double>(entries, nan)};
  Scratch scratch;
  cost.evaluate(states.batch(), {out.residuals, out.jacobian_q, out.jacobian_qdot}, scratch);
  return out;
}

/// Every element is written, and a batch gives what its states give one by one.
inline void expect_batch_consistent(const StateCost& cost, const States& states) {
  SCOPED_TRACE(std::string(cost.name()));
  const Evaluation all = evaluate(cost, states);
  for (const auto* values : {&all.residuals, &all.jacobian_q, &all.jacobian_qdot}) {
    for (std::size_t i = 0; i < values->size(); ++i) {
      ASSERT_TRUE(std::isfinite((*values)[i])) << "element " << i << " was not written";
    }
  }
  if (!cost.depends_on_velocity()) {
    for (const double entry : all.jacobian_qdot) ASSERT_EQ(entry, 0.0);
  }
  EXPECT_EQ(evaluate(cost, states, false).residuals, all.residuals)
      << "residuals change when no Jacobian is asked for";
  const auto part = [&](const std::vector<double>& values, int i) {
    const auto size = static_cast<std::ptrdiff_t>(values.size()) / states.count();
    return std::vector<double>(values.begin() + i * size, values.begin() + (i + 1) * size);
  };
  for (int i = 0; i < states.count(); ++i) {
    const Evaluation alone = evaluate(cost, states.one(i));
    EXPECT_EQ(alone.residuals, part(all.residuals, i)) << "state " << i;
    EXPECT_EQ(alone.jacobian_q, part(all.jacobian_q, i)) << "state " << i;
    EXPECT_EQ(alone.jacobian_qdot, part(all.jacobian_qdot, i)) << "state " << i;
  }
}

/// Jacobians against central differences. Where the one-sided differences disagree there is a
/// kink, and nothing to compare. Returns the number of non-zero Jacobian entries compared, so
/// that a test can see that the cost was active at all.
[[nodiscard]] inline int expect_jacobians_match_differences(const StateCost& cost,
                                                            const States& states,
                                                            double relative_tolerance = 1e-5) {
  SCOPED_TRACE(std::string(cost.name()));
  constexpr double kStep = 1e-6;
  const int d = states.dof;
  const int m = cost.residual_count();
  const Evaluation at = evaluate(cost, states);
  int compared = 0;
  for (int velocity = 0; velocity < 2; ++velocity) {
    const std::vector<double>& jacobian = velocity ? at.jacobian_qdot : at.jacobian_q;
    for (int j = 0; j < d; ++j) {
      States above = states, below = states;
      for (int i = 0; i < states.count(); ++i) {
        const auto k = static_cast<std::size_t>(i * d + j);
        (velocity ? above.qdot : above.q)[k] += kStep;
        (velocity ? below.qdot : below.q)[k] -= kStep;
      }
      const std::vector<double> up = evaluate(cost, above, false).residuals;
      const std::vector<double> down = evaluate(cost, below, false).residuals;
      for (std::size_t row = 0; row < up.size(); ++row) {
        const double forward = (up[row] - at.residuals[row]) / kStep;
        const double backward = (at.residuals[row] - down[row]) / kStep;
        const double scale = 1.0 + std::abs(forward) + std::abs(backward);
        if (std::abs(forward - backward) > 1e-3 * scale) continue;
        const double entry =
            jacobian[row * static_cast<std::size_t>(d) + static_cast<std::size_t>(j)];
        EXPECT_NEAR(entry, 0.5 * (forward + backward), relative_tolerance * scale)
            << "state " << row / static_cast<std::size_t>(m) << ", residual "
            << row % static_cast<std::size_t>(m) << ", by "
            << (velocity ? "velocity " : "position ") << j;
        if (entry != 0.0) ++compared;
      }
    }
  }
  return compared;
}

/// The linearise_tolerance of a cost that linearises in single precision, as that of obstacles
/// does: positions of about a metre are rounded to some 1e-6, within which a field's gradient
/// changes by that over the size of a voxel.
inline constexpr double kSinglePrecision = 1e-4;

/// linearise() against the products of what evaluate() gives, at every other one of more states.
inline void expect_linearises(const StateCost& cost, const States& states,
                              double relative_tolerance = 1e-9) {
  SCOPED_TRACE(std::string(cost.name()));
  const auto d = static_cast<std::size_t>(states.dof);
  const auto m = static_cast<std::size_t>(cost.residual_count());
  const auto n = static_cast<std::size_t>(states.count());
  StateNormals normals;
  normals.resize(static_cast<int>(2 * n + 1), states.dof);
  Scratch scratch;
  const double sum = cost.linearise(states.batch(), {1, 2}, normals, scratch);

  const Evaluation at = evaluate(cost, states);
  double expected_cost = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t state = 1 + 2 * i;
    EXPECT_FALSE(normals.has_position(state - 1) || normals.has_full(state - 1));
    // The Jacobian of a residual by [q; qdot].
    const auto entry = [&](std::size_t row, std::size_t v) {
      return v < d ? at.jacobian_q[(i * m + row) * d + v]
                   : at.jacobian_qdot[(i * m + row) * d + v - d];
    };
    const auto full = normals.full(state), position = normals.position(state);
    for (std::size_t a = 0; a < 2 * d; ++a) {
      double gradient = 0.0;
      double scale = 1.0;
      for (std::size_t row = 0; row < m; ++row) {
        gradient += entry(row, a) * at.residuals[i * m + row];
        scale += std::abs(entry(row, a) * at.residuals[i * m + row]);
      }
      EXPECT_NEAR(full.gradient[a] + (a < d ? position.gradient[a] : 0.0), gradient,
                  relative_tolerance * scale)
          << "state " << i << ", variable " << a;
      for (std::size_t b = 0; b < 2 * d; ++b) {
        double product = 0.0;
        scale = 1.0;
        for (std::size_t row = 0; row < m; ++row) {
          product += entry(row, a) * entry(row, b);
          scale += std::abs(entry(row, a) * entry(row, b));
        }
        const double of_positions =
            a < d && b < d ? position.hessian[a * normals.position_stride() + b] : 0.0;
        EXPECT_NEAR(full.hessian[a * normals.full_stride() + b] + of_positions, product,
                    relative_tolerance * scale)
            << "state " << i << ", variables " << a << " and " << b;
      }
    }
    for (std::size_t row = 0; row < m; ++row) {
      expected_cost += 0.5 * at.residuals[i * m + row] * at.residuals[i * m + row];
    }
  }
  EXPECT_NEAR(sum, expected_cost, relative_tolerance * (1.0 + expected_cost));
}

/// States a little before and behind where a residual begins: between each two neighbours of which
/// it is zero at one only, found by bisection.
[[nodiscard]] inline States states_next_to_kinks(const StateCost& cost, const States& states) {
  constexpr double kOff = 1e-4;  // of the way between the two
  const auto between = [&](int i, double share) {
    States at = states.one(i);
    const States to = states.one(i + 1);
    for (std::size_t j = 0; j < at.q.size(); ++j) {
      at.q[j] += share * (to.q[j] - at.q[j]);
      at.qdot[j] += share * (to.qdot[j] - at.qdot[j]);
    }
    return at;
  };
  const Evaluation all = evaluate(cost, states, false);
  const auto m = static_cast<std::size_t>(cost.residual_count());
  States found{states.dof, {}, {}, {}};
  for (int i = 0; i + 1 < states.count(); ++i) {
    for (std::size_t row = 0; row < m; ++row) {
      const std::size_t at = static_cast<std::size_t>(i) * m + row;
      const bool is_zero = all.residuals[at] == 0.0;
      if (is_zero == (all.residuals[at + m] == 0.0)) continue;
      double low = 0.0, high = 1.0;
      while (high - low > 1e-12) {
        const double middle = 0.5 * (low + high);
        const double residual = evaluate(cost, between(i, middle), false).residuals[row];
        ((residual == 0.0) == is_zero ? low : high) = middle;
      }
      for (const double share : {low - kOff, high + kOff}) {
        const States state = between(i, share);
        found.q.insert(found.q.end(), state.q.begin(), state.q.end());
        found.qdot.insert(found.qdot.end(), state.qdot.begin(), state.qdot.end());
        found.times_s.push_back(state.times_s.front());
      }
    }
  }
  return found;
}

/// All of the above, at the states and next to where residuals begin; `states` must include some at
/// which the cost is not zero.
inline void expect_conforms(const StateCost& cost, const States& states,
                            double linearise_tolerance = 1e-9) {
  EXPECT_FALSE(cost.name().empty());
  expect_batch_consistent(cost, states);
  EXPECT_GT(expect_jacobians_match_differences(cost, states), 0)
      << cost.name() << " is zero at every state of the test";
  expect_linearises(cost, states, linearise_tolerance);
  const States kinks = states_next_to_kinks(cost, states);
  if (kinks.count() == 0) return;
  EXPECT_GT(expect_jacobians_match_differences(cost, kinks), 0);
  expect_linearises(cost, kinks, linearise_tolerance);
}

}  // namespace sidestep::conformance
