#include "body_chain.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

#include <sidestep/core/index.hpp>

#include "interval_blocks.hpp"

namespace sidestep {
namespace {

/// Vectors of the plane are complex numbers: those of world and body differ by a factor.
using Complex = std::complex<double>;
constexpr Complex kI(0.0, 1.0);
/// Below it, rad, series stand for what loses its digits.
constexpr double kSmallTurn = 1e-3;

struct Factor {
  Complex value;
  Complex by_turn;
};

/// Of a motion that is even in its own frame and turns by `turn`: its way in that frame over its
/// chord, the inverse of SE(2)'s V.
Factor way_of_chord(double turn) noexcept {
  const double half = 0.5 * turn, squared = turn * turn;
  if (std::abs(turn) < kSmallTurn) {
    return {{1.0 - squared / 12.0, -half}, {-turn / 6.0, -0.5}};
  }
  const double sine = std::sin(half), cotangent = std::cos(half) / sine;
  return {{half * cotangent, -half}, {0.5 * (cotangent - half / (sine * sine)), -0.5}};
}

/// Its chord over its way: V.
Factor chord_of_way(double turn) noexcept {
  const double squared = turn * turn;
  if (std::abs(turn) < kSmallTurn) {
    return {{1.0 - squared / 6.0, 0.5 * turn}, {-turn / 3.0, 0.5 - squared / 8.0}};
  }
  const Complex rotation = std::polar(1.0, turn);
  return {(rotation - 1.0) / (kI * turn), (turn * rotation + kI * (rotation - 1.0)) / squared};
}

Complex vector_of(const auto& values, Eigen::Index first) {
  return {values[first], values[first + 1]};
}

void set_vector(auto&& values, Eigen::Index first, const Complex& vector) {
  values[first] = vector.real();
  values[first + 1] = vector.imag();
}

/// A vector of the plane that follows from two states, and its derivatives by both.
struct Vector {
  Complex value;
  std::array<Complex, 12> by_states{};

  friend Vector operator*(const Complex& factor, Vector vector) {
    vector.value *= factor;
    for (Complex& derivative : vector.by_states) derivative *= factor;
    return vector;
  }
  friend Vector operator+(Vector a, const Vector& b) {
    a.value += b.value;
    for (std::size_t k = 0; k < 12; ++k) a.by_states[k] += b.by_states[k];
    return a;
  }
};

/// The velocity of a state's body in its own frame; its derivatives begin at `first`.
Vector body_velocity(const Eigen::Matrix<double, 6, 1>& state, std::size_t first) {
  const Complex into_body = std::polar(1.0, -state[2]);
  Vector speed{into_body * vector_of(state, 3)};
  speed.by_states[first + 2] = -kI * speed.value;
  speed.by_states[first + 3] = into_body;
  speed.by_states[first + 4] = into_body * kI;
  return speed;
}

/// The place in log(T_a^-1 T_b), along the body's axes.
Vector way_between(const Eigen::Matrix<double, 6, 1>& a, const Eigen::Matrix<double, 6, 1>& b) {
  const Complex into_body = std::polar(1.0, -a[2]);
  const Complex chord = into_body * (vector_of(b, 0) - vector_of(a, 0));
  const Factor factor = way_of_chord(b[2] - a[2]);
  Vector way{factor.value * chord};
  const Complex by_x = factor.value * into_body;
  way.by_states[0] = -by_x;
  way.by_states[1] = -kI * by_x;
  way.by_states[2] = -kI * way.value - factor.by_turn * chord;
  way.by_states[6] = by_x;
  way.by_states[7] = kI * by_x;
  way.by_states[8] = factor.by_turn * chord;
  return way;
}

}  // namespace

BodyChain::BodyChain(const Base& base, const Eigen::VectorXd& qc, double dt_s)
    : base_(base), qc_(qc), dof_(idx(qc.size())), dt_s_(dt_s) {
  whitening_.setZero();
  for (const Eigen::Index axis : {0, 1, 2}) {
    const Eigen::Matrix2d joint = GpPrior({}, dt_s).whitening() / std::sqrt(qc[base[idx(axis)]]);
    whitening_(Eigen::seqN(axis, Eigen::fix<2>, Eigen::fix<3>),
               Eigen::seqN(axis, Eigen::fix<2>, Eigen::fix<3>)) = joint;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    variables_[axis] = idx(base[axis]);
    variables_[axis + 3] = dof_ + idx(base[axis]);
  }
}

BodyChain::State BodyChain::state_of(const double* values) const noexcept {
  State state;
  for (Eigen::Index k = 0; k < 6; ++k) state[k] = values[variables_[idx(k)]];
  return state;
}

/// e = (dt xi_a - log(T_a^-1 T_b), xi_a - xi_b), xi the velocity of the body in its own frame;
/// whitened.
BodyChain::Derived BodyChain::residual(const double* a, const double* b) const noexcept {
  const State from = state_of(a), to = state_of(b);
  const Vector speed = body_velocity(from, 0);
  const Vector place = dt_s_ * speed + -1.0 * way_between(from, to);
  const Vector change = speed + -1.0 * body_velocity(to, 6);
  Derived e;
  set_vector(e.value, 0, place.value);
  set_vector(e.value, 3, change.value);
  e.value[2] = dt_s_ * from[5] - (to[2] - from[2]);
  e.value[5] = from[5] - to[5];
  for (Eigen::Index k = 0; k < 12; ++k) {
    set_vector(e.by_states.col(k), 0, place.by_states[idx(k)]);
    set_vector(e.by_states.col(k), 3, change.by_states[idx(k)]);
  }
  e.by_states(2, 2) = e.by_states(5, 5) = 1.0;
  e.by_states(2, 5) = dt_s_;
  e.by_states(2, 8) = e.by_states(5, 11) = -1.0;
  return {whitening_ * e.value, whitening_ * e.by_states};
}

double BodyChain::cost(const double* a, const double* b) const noexcept {
  return 0.5 * residual(a, b).value.squaredNorm();
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
    const Derived r = residual(a, a + 2 * dof_);
    const Eigen::Matrix<double, 6, 6> by_a = r.by_states.leftCols<6>();
    const Eigen::Matrix<double, 6, 6> by_b = r.by_states.rightCols<6>();
    add(system.own_block(i), by_a.transpose() * by_a);
    add(system.coupling(i), by_b.transpose() * by_a);
    add(system.own_block(i + 1), by_b.transpose() * by_b);
    const State force_a = by_a.transpose() * r.value, force_b = by_b.transpose() * r.value;
    for (std::size_t k = 0; k < 6; ++k) {
      system.rhs(i)[variables_[k]] -= force_a.data()[k];
      system.rhs(i + 1)[variables_[k]] -= force_b.data()[k];
    }
  }
}

/// T = T_a exp(w), w = Lambda12 xi_a + Psi11 log(T_a^-1 T_b) + Psi12 xi_b; its velocity that of
/// the second rows.
BodyChain::Derived BodyChain::between(const double* a, const double* b,
                                      const GpPrior::Interpolation& at) const noexcept {
  const State from = state_of(a), to = state_of(b);
  const Vector speed_a = body_velocity(from, 0), speed_b = body_velocity(to, 6);
  const Vector whole = way_between(from, to);
  const auto mix = [&](Eigen::Index row) {
    return at.lambda(row, 1) * speed_a + at.psi(row, 0) * whole + at.psi(row, 1) * speed_b;
  };
  const Vector way = mix(0), speed = mix(1);
  Derived state;
  std::array<double, 12> turn_by{};
  for (const Eigen::Index row : {0, 1}) {
    Eigen::Matrix<double, 1, 12> by = Eigen::Matrix<double, 1, 12>::Zero();
    by[2] = -at.psi(row, 0);
    by[5] = at.lambda(row, 1);
    by[8] = at.psi(row, 0);
    by[11] = at.psi(row, 1);
    const double value =
        at.lambda(row, 1) * from[5] + at.psi(row, 0) * (to[2] - from[2]) + at.psi(row, 1) * to[5];
    if (row == 0) std::copy_n(by.data(), 12, turn_by.begin());
    state.value[2 + 3 * row] = value;
    state.by_states.row(2 + 3 * row) = by;
  }
  const Factor chord = chord_of_way(state.value[2]);
  const Complex into_world = std::polar(1.0, from[2]);
  const Complex moved = into_world * chord.value * way.value;
  const Complex out = into_world * std::polar(1.0, state.value[2]);
  set_vector(state.value, 0, vector_of(from, 0) + moved);
  set_vector(state.value, 3, out * speed.value);
  for (Eigen::Index k = 0; k < 12; ++k) {
    const double by_turn = turn_by[idx(k)], by_heading = k == 2 ? 1.0 : 0.0;
    Complex place =
        into_world * (chord.value * way.by_states[idx(k)] + chord.by_turn * by_turn * way.value) +
        kI * by_heading * moved;
    if (k == 0) place += 1.0;
    if (k == 1) place += kI;
    set_vector(state.by_states.col(k), 0, place);
    set_vector(state.by_states.col(k), 3,
               out * (speed.by_states[idx(k)] + kI * (by_turn + by_heading) * speed.value));
  }
  state.value[2] += from[2];
  state.by_states(2, 2) += 1.0;
  return state;
}

void BodyChain::interpolate(const double* a, const double* b, const GpPrior::Interpolation& at,
                            double* q, double* qdot) const noexcept {
  const Derived state = between(a, b, at);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    q[base_[idx(axis)]] = state.value[axis];
    qdot[base_[idx(axis)]] = state.value[axis + 3];
  }
}

void BodyChain::set_chain(const Derived& between, const GpPrior::Interpolation& at) {
  chain_.resize(4 * dof_);
  for (std::size_t m = 0; m < 4; ++m) {
    const Eigen::Matrix2d& part = m < 2 ? at.lambda : at.psi;
    const auto side = static_cast<Eigen::Index>(m % 2);
    for (std::size_t j = 0; j < dof_; ++j) {
      Column& column = chain_[m * dof_ + j];
      column.rows[0] = j;
      column.rows[1] = dof_ + j;
      column.weights[0] = part(0, side);
      column.weights[1] = part(1, side);
      column.positions = 1;
      column.count = 2;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      Column& column = chain_[m * dof_ + variables_[axis]];
      const auto by = between.by_states.col(static_cast<Eigen::Index>(3 * m + axis));
      column.rows = variables_;
      std::copy_n(by.data(), 6, column.weights.begin());
      column.positions = 3;
      column.count = 6;
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
  for (std::size_t k = 0; k < checks.size(); ++k) {
    const std::size_t state = first + k;
    if (!normals.has_position(state) && !normals.has_full(state)) continue;
    set_chain(between(a, a + 2 * dof_, checks[k]), checks[k]);
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
  const auto [x, y, yaw, vx, vy, rate] = variables_;
  /// Turns three values, `stride` apart, by T'.
  const auto turn = [&](double* values, std::size_t stride, int state) {
    const State at = state_of(support.data() + idx(state) * 2 * dof_);
    const double sin = std::sin(at[2]), cos = std::cos(at[2]);
    double &by_yaw = values[yaw * stride], &by_x = values[vx * stride], &by_y = values[vy * stride];
    by_yaw += at[3] * by_y - at[4] * by_x;
    const double along = cos * by_x + sin * by_y;
    by_y = cos * by_y - sin * by_x;
    by_x = along;
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
    const State from = state_of(support.data() + at), to = state_of(moved.data() + at);
    const Complex before = vector_of(from, 3), step = vector_of(to, 3) - before;
    const Complex speed = std::polar(1.0, to[2]) * (std::polar(1.0, -from[2]) * before + step);
    moved[at + variables_[3]] = speed.real();
    moved[at + variables_[4]] = speed.imag();
  }
}

}  // namespace sidestep
