#include "body_chain.hpp"

#include <algorithm>
#include <cmath>

#include <unsupported/Eigen/AutoDiff>

#include <sidestep/core/index.hpp>

#include "interval_blocks.hpp"

namespace sidestep {
namespace {

// Of the base: x, y and heading, then their velocities. T is a number, or one with its derivatives.
template <class T>
using State = Eigen::Matrix<T, 6, 1>;
template <class T>
using Twist = Eigen::Matrix<T, 3, 1>;
using Derivatives = Eigen::AutoDiffScalar<Eigen::Matrix<double, 12, 1>>;

/// Below it, rad, series stand for what loses its digits.
constexpr double kSmallTurn = 1e-3;

/// Its first two values turned, the rest as it is.
template <class T, int n>
Eigen::Matrix<T, n, 1> rotated(Eigen::Matrix<T, n, 1> vector, const T& angle) {
  using std::cos, std::sin;
  const T c = cos(angle), s = sin(angle);
  const T x = c * vector[0] - s * vector[1];
  vector[1] = s * vector[0] + c * vector[1];
  vector[0] = x;
  return vector;
}

/// The velocity of the body in its own frame.
template <class T>
Twist<T> twist_of(const State<T>& state) {
  return rotated<T, 3>(state.template tail<3>(), -state[2]);
}

/// log(T_a^-1 T_b).
template <class T>
Twist<T> log_between(const State<T>& a, const State<T>& b) {
  using std::abs, std::cos, std::sin;
  Twist<T> way = rotated<T, 3>(b.template head<3>() - a.template head<3>(), -a[2]);
  const T& turn = way[2];
  const T half = 0.5 * turn;
  const T along =
      abs(turn) < kSmallTurn ? T(1.0 - turn * turn / 12.0) : T(half * cos(half) / sin(half));
  const T x = along * way[0] + half * way[1];
  way[1] = along * way[1] - half * way[0];
  way[0] = x;
  return way;
}

/// The place and heading of exp(way).
template <class T>
Twist<T> exp_of(const Twist<T>& way) {
  using std::abs, std::sin;
  const T& turn = way[2];
  const T squared = turn * turn;
  T along = 1.0 - squared / 6.0, across = turn * (0.5 - squared / 24.0);
  if (abs(turn) >= kSmallTurn) {
    const T half_sine = sin(T(0.5 * turn));
    along = sin(turn) / turn;
    across = 2.0 * half_sine * half_sine / turn;
  }
  return {along * way[0] - across * way[1], across * way[0] + along * way[1], turn};
}

/// e = (dt xi_a - log(T_a^-1 T_b), xi_a - xi_b).
template <class T>
State<T> prior_error(const State<T>& a, const State<T>& b, double dt_s) {
  const Twist<T> speed_a = twist_of(a);
  State<T> error;
  error << T(dt_s) * speed_a - log_between(a, b), speed_a - twist_of(b);
  return error;
}

/// T = T_a exp(w), w = Lambda12 xi_a + Psi11 log(T_a^-1 T_b) + Psi12 xi_b; its velocity that of
/// the second rows.
template <class T>
State<T> between(const State<T>& a, const State<T>& b, const GpPrior::Interpolation& at) {
  const Twist<T> speed_a = twist_of(a), whole = log_between(a, b), speed_b = twist_of(b);
  const auto mixed = [&](Eigen::Index row) -> Twist<T> {
    return T(at.lambda(row, 1)) * speed_a + T(at.psi(row, 0)) * whole + T(at.psi(row, 1)) * speed_b;
  };
  const Twist<T> place = a.template head<3>() + rotated<T, 3>(exp_of(mixed(0)), a[2]);
  State<T> state;
  state << place, rotated<T, 3>(mixed(1), place[2]);
  return state;
}

/// A state whose derivatives begin at `first`.
State<Derivatives> with_derivatives(const State<double>& values, Eigen::Index first) {
  State<Derivatives> state;
  for (Eigen::Index k = 0; k < 6; ++k) state[k] = Derivatives(values[k], 12, first + k);
  return state;
}

/// The derivatives of a function of two states, row by row.
Eigen::Matrix<double, 6, 12> derivatives_of(const State<Derivatives>& state) {
  Eigen::Matrix<double, 6, 12> by_states;
  for (Eigen::Index k = 0; k < 6; ++k) by_states.row(k) = state[k].derivatives().transpose();
  return by_states;
}

}  // namespace

BodyChain::BodyChain(const Base& base, const Eigen::VectorXd& qc, double dt_s)
    : base_(base), qc_(qc), dof_(idx(qc.size())), dt_s_(dt_s), chain_(4 * dof_) {
  const Eigen::Matrix2d whitening = GpPrior({}, dt_s).whitening();
  whitening_.setZero();
  for (const Eigen::Index axis : {0, 1, 2}) {
    const auto rows = Eigen::seqN(axis, Eigen::fix<2>, Eigen::fix<3>);
    whitening_(rows, rows) = whitening / std::sqrt(qc[base[idx(axis)]]);
    variables_[idx(axis)] = idx(base[idx(axis)]);
    variables_[idx(axis) + 3] = dof_ + idx(base[idx(axis)]);
  }
  product_.reserve(2 * dof_ * dof_);
}

Eigen::Matrix<double, 6, 1> BodyChain::state_of(const double* values) const noexcept {
  State<double> state;
  for (Eigen::Index k = 0; k < 6; ++k) state[k] = values[variables_[idx(k)]];
  return state;
}

double BodyChain::cost(const double* a, const double* b) const noexcept {
  return 0.5 * (whitening_ * prior_error(state_of(a), state_of(b), dt_s_)).squaredNorm();
}

void BodyChain::add_prior(ChainSystem& system, std::span<const double> support) const noexcept {
  const auto add = [&](double* block, const Eigen::Matrix<double, 6, 6>& values) {
    for (std::size_t column = 0; column < 6; ++column) {
      double* const to = block + variables_[column] * system.stride();
      for (std::size_t row = 0; row < 6; ++row) {
        to[variables_[row]] += values.data()[6 * column + row];
      }
    }
  };
  for (int i = 0; i + 1 < system.states(); ++i) {
    const double* const a = support.data() + idx(i) * 2 * dof_;
    const State<double> from = state_of(a), to = state_of(a + 2 * dof_);
    const State<double> r = whitening_ * prior_error(from, to, dt_s_);
    const Eigen::Matrix<double, 6, 12> by_states =
        whitening_ *
        derivatives_of(prior_error(with_derivatives(from, 0), with_derivatives(to, 6), dt_s_));
    const Eigen::Matrix<double, 6, 6> by_a = by_states.leftCols<6>();
    const Eigen::Matrix<double, 6, 6> by_b = by_states.rightCols<6>();
    add(system.own_block(i), by_a.transpose() * by_a);
    add(system.coupling(i), by_b.transpose() * by_a);
    add(system.own_block(i + 1), by_b.transpose() * by_b);
    const State<double> force_a = by_a.transpose() * r, force_b = by_b.transpose() * r;
    for (std::size_t k = 0; k < 6; ++k) {
      system.rhs(i)[variables_[k]] -= force_a.data()[k];
      system.rhs(i + 1)[variables_[k]] -= force_b.data()[k];
    }
  }
}

void BodyChain::interpolate(const double* a, const double* b, const GpPrior::Interpolation& at,
                            double* q, double* qdot) const noexcept {
  const State<double> state = between(state_of(a), state_of(b), at);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    q[base_[axis]] = state.data()[axis];
    qdot[base_[axis]] = state.data()[axis + 3];
  }
}

void BodyChain::set_chain(const Eigen::Matrix<double, 6, 12>& by_states,
                          const GpPrior::Interpolation& at) {
  for (std::size_t m = 0; m < 4; ++m) {
    const Eigen::Matrix2d& part = m < 2 ? at.lambda : at.psi;
    const auto side = static_cast<Eigen::Index>(m % 2);
    for (std::size_t j = 0; j < dof_; ++j) {
      chain_[m * dof_ + j] = {{j, dof_ + j}, {part(0, side), part(1, side)}, 1, 2};
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Column& column = chain_[m * dof_ + variables_[axis]];
      column = {variables_, {}, 3, 6};
      std::copy_n(by_states.col(static_cast<Eigen::Index>(3 * m + axis)).data(), 6,
                  column.weights.begin());
    }
  }
}

/// `width`: of the block, dof or twice that.
void BodyChain::add_state(const StateNormals::Block& block, std::size_t stride, std::size_t width,
                          ChainSystem& system, int interval) {
  const auto count = [&](const Column& column) {
    return width == dof_ ? column.positions : column.count;
  };
  for (std::size_t n = 0; n < 4; ++n) {
    // H times the columns of this part, one after the other.
    product_.assign(dof_ * width, 0.0);
    for (std::size_t j = 0; j < dof_; ++j) {
      const Column& column = chain_[n * dof_ + j];
      double force = 0.0;
      for (std::size_t k = 0; k < count(column); ++k) {
        const double* from = block.hessian + column.rows[k] * stride;
        for (std::size_t r = 0; r < width; ++r) {
          product_[j * width + r] += column.weights[k] * from[r];
        }
        force += column.weights[k] * block.gradient[column.rows[k]];
      }
      interval_rhs(system, interval, n, dof_)[j] -= force;
    }
    for (std::size_t m = n; m < 4; ++m) {
      double* const to = interval_block(system, interval, m, n, dof_);
      for (std::size_t j = 0; j < dof_; ++j) {
        for (std::size_t r = 0; r < dof_; ++r) {
          const Column& row = chain_[m * dof_ + r];
          double sum = 0.0;
          for (std::size_t k = 0; k < count(row); ++k) {
            sum += row.weights[k] * product_[j * width + row.rows[k]];
          }
          to[j * system.stride() + r] += sum;
        }
      }
    }
  }
}

void BodyChain::add_interval(const StateNormals& normals, std::size_t first,
                             std::span<const GpPrior::Interpolation> checks,
                             std::span<const double> support, ChainSystem& system, int interval) {
  const double* const a = support.data() + idx(interval) * 2 * dof_;
  const auto from = with_derivatives(state_of(a), 0);
  const auto to = with_derivatives(state_of(a + 2 * dof_), 6);
  for (std::size_t k = 0; k < checks.size(); ++k) {
    const std::size_t state = first + k;
    if (!normals.has_position(state) && !normals.has_full(state)) continue;
    set_chain(derivatives_of(between(from, to, checks[k])), checks[k]);
    if (normals.has_position(state)) {
      add_state(normals.position(state), padded(dof_), dof_, system, interval);
    }
    if (normals.has_full(state)) {
      add_state(normals.full(state), normals.full_stride(), 2 * dof_, system, interval);
    }
  }
}

/// By T' H T and T' b, T = d[q; qdot] / d[q; xi]: xi = R' qdot of the base.
void BodyChain::turn_into_body(ChainSystem& system,
                               std::span<const double> support) const noexcept {
  const std::size_t yaw = variables_[2], vx = variables_[3], vy = variables_[4];
  // Turns three values, `stride` apart, by T'.
  const auto turn = [&](double* values, std::size_t stride, int state) {
    const State<double> at = state_of(support.data() + idx(state) * 2 * dof_);
    double &by_yaw = values[yaw * stride], &by_x = values[vx * stride], &by_y = values[vy * stride];
    by_yaw += at[3] * by_y - at[4] * by_x;
    const Eigen::Vector2d in_body = rotated<double, 2>({by_x, by_y}, -at[2]);
    by_x = in_body.x();
    by_y = in_body.y();
  };
  const auto width = idx(system.width());
  for (int i = 0; i < system.states(); ++i) {
    double* const own = system.own_block(i);
    const std::size_t stride = system.stride();
    for (std::size_t column = 0; column < width; ++column) {
      for (std::size_t row = column + 1; row < width; ++row) {
        own[row * stride + column] = own[column * stride + row];
      }
    }
    const bool has_next = i + 1 < system.states();
    for (std::size_t row = 0; row < width; ++row) {
      turn(own + row, stride, i);
      if (has_next) turn(system.coupling(i) + row, stride, i);
    }
    for (std::size_t column = 0; column < width; ++column) {
      turn(own + column * stride, 1, i);
      if (has_next) turn(system.coupling(i) + column * stride, 1, i + 1);
    }
    turn(system.rhs(i), 1, i);
  }
}

void BodyChain::turn_into_world(std::span<const double> support,
                                std::span<double> moved) const noexcept {
  for (std::size_t at = 0; at < moved.size(); at += 2 * dof_) {
    // A step of nothing leaves what it was, to the bit.
    const State<double> from = state_of(support.data() + at), to = state_of(moved.data() + at);
    const Eigen::Vector2d before = from.segment<2>(3), step = to.segment<2>(3) - before;
    const Eigen::Vector2d speed =
        rotated<double, 2>(before, to[2] - from[2]) + rotated<double, 2>(step, to[2]);
    moved[at + variables_[3]] = speed.x();
    moved[at + variables_[4]] = speed.y();
  }
}

}  // namespace sidestep
