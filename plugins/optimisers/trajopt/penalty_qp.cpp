#include "penalty_qp.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep {
namespace {

using Array = Eigen::ArrayXd;
using Vector = Eigen::VectorXd;

constexpr int kMostSteps = 60;
constexpr double kTolerance = 1e-7;       ///< Of duality gap and gradient, relative.
constexpr double kLeastHalfWidth = 1e-9;  ///< Of a variable that may not move.
constexpr double kToBoundary = 0.995;     ///< Share of the way to the boundary that a step goes.

/// The hinges that may cost anything within the bounds.
std::vector<const Hinge*> felt(const PenaltyQp& qp) {
  std::vector<const Hinge*> out;
  for (const Hinge& hinge : qp.hinges) {
    double most = hinge.bound;
    for (std::size_t i = 0; i < hinge.coefficients.size(); ++i) {
      const Eigen::Index at = hinge.first + static_cast<Eigen::Index>(i);
      most -= std::min(hinge.coefficients[i] * qp.lower[at], hinge.coefficients[i] * qp.upper[at]);
    }
    if (!(most < 0.0)) out.push_back(&hinge);
  }
  return out;
}

/// The largest share of a step that keeps values positive, at most 1.
double longest(const Array& values, const Array& step) {
  double share = 1.0;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (step[i] < 0.0) share = std::min(share, -kToBoundary * values[i] / step[i]);
  }
  return share;
}

/// Iterate and Newton system of one minimisation. Every pair of a distance to a boundary and its
/// multiplier is driven to the same, ever smaller, product.
class InteriorPoint {
 public:
  explicit InteriorPoint(const PenaltyQp& qp) : qp_(qp), hinges_(felt(qp)), system_(qp.h) {
    const Array centre = 0.5 * (qp.lower + qp.upper);
    const Array half = (0.5 * (qp.upper - qp.lower)).array().max(kLeastHalfWidth);
    x_ = centre;
    lower_ = centre - half;
    upper_ = centre + half;
    weight_.resize(static_cast<Eigen::Index>(hinges_.size()));
    for (Eigen::Index k = 0; k < weight_.size(); ++k) weight_[k] = at(k).weight;
    multiplier_ = 0.5 * weight_;
    const Array short_by = shortfalls();
    const double scale = std::max(1e-3, half.maxCoeff());
    slack_ = short_by.max(0.0) + scale;
    margin_ = slack_ - short_by;
    const double pull = std::max(1e-6, gradient().cwiseAbs().maxCoeff());
    below_ = above_ = Array::Constant(x_.size(), pull);
    factor_.analyzePattern(system_.lower());
  }

  [[nodiscard]] const Vector& x() const noexcept { return x_; }

  [[nodiscard]] bool is_done() const {
    const double gap = products().sum();
    return gap <= kTolerance * (1.0 + std::abs(qp_.value(x_))) &&
           dual_residual().cwiseAbs().maxCoeff() <=
               kTolerance * (1.0 + qp_.g.cwiseAbs().maxCoeff());
  }

  /// False where the system is singular or the numbers overflow.
  [[nodiscard]] bool step() {
    if (!factorise()) return false;
    const Array now = products();
    const double mean = now.mean();
    const Step affine = solve(-now);
    const double reach = std::min(affine.primal, affine.dual);
    const double after = (products(affine, reach)).mean();
    const double centring = std::pow(after / mean, 3);
    const Step step = solve(centring * mean - now - affine.corrections);
    const double share = std::min(step.primal, step.dual);
    x_ += share * step.x.matrix();
    slack_ += share * step.slack;
    margin_ += share * step.margin;
    multiplier_ += share * step.multiplier;
    below_ += share * step.below;
    above_ += share * step.above;
    return x_.allFinite() && multiplier_.allFinite();
  }

 private:
  struct Step {
    Array x, slack, margin, multiplier, below, above;
    Array corrections;  ///< Products of the steps of each pair.
    double primal = 1.0, dual = 1.0;
  };

  [[nodiscard]] const Hinge& at(Eigen::Index k) const {
    return *hinges_[static_cast<std::size_t>(k)];
  }
  [[nodiscard]] Array shortfalls() const {
    Array out(weight_.size());
    for (Eigen::Index k = 0; k < out.size(); ++k) out[k] = at(k).shortfall(x_);
    return out;
  }
  [[nodiscard]] Vector gradient() const {
    Vector out = qp_.h.times(x_) + qp_.g;
    add_transposed(-multiplier_, out);
    return out;
  }
  [[nodiscard]] Vector dual_residual() const {
    return gradient() - below_.matrix() + above_.matrix();
  }
  /// out += A^T y
  void add_transposed(const Array& y, Vector& out) const {
    for (Eigen::Index k = 0; k < y.size(); ++k) {
      const auto& a = at(k).coefficients;
      for (std::size_t i = 0; i < a.size(); ++i) {
        out[at(k).first + static_cast<Eigen::Index>(i)] += a[i] * y[k];
      }
    }
  }
  [[nodiscard]] Array times_a(const Array& x) const {
    Array out(weight_.size());
    for (Eigen::Index k = 0; k < out.size(); ++k) {
      const auto& a = at(k).coefficients;
      out[k] = Eigen::Map<const Array>(a.data(), static_cast<Eigen::Index>(a.size()))
                   .cwiseProduct(x.segment(at(k).first, static_cast<Eigen::Index>(a.size())))
                   .sum();
    }
    return out;
  }

  /// Of all pairs: margins, slacks, lower bounds, upper bounds.
  [[nodiscard]] Array joined(const Array& a, const Array& b, const Array& c, const Array& d) const {
    Array out(a.size() + b.size() + c.size() + d.size());
    out << a, b, c, d;
    return out;
  }
  [[nodiscard]] Array products() const {
    return joined(margin_ * multiplier_, slack_ * (weight_ - multiplier_),
                  (x_.array() - lower_) * below_, (upper_ - x_.array()) * above_);
  }
  [[nodiscard]] Array products(const Step& step, double share) const {
    const Array multiplier = multiplier_ + share * step.multiplier;
    const Array x = x_.array() + share * step.x;
    return joined((margin_ + share * step.margin) * multiplier,
                  (slack_ + share * step.slack) * (weight_ - multiplier),
                  (x - lower_) * (below_ + share * step.below),
                  (upper_ - x) * (above_ + share * step.above));
  }

  bool factorise() {
    stiffness_ = (margin_ / multiplier_ + slack_ / (weight_ - multiplier_)).inverse();
    system_ = qp_.h;
    const Array diagonal = below_ / (x_.array() - lower_) + above_ / (upper_ - x_.array());
    for (int i = 0; i < system_.size(); ++i) system_.add(i, i, diagonal[i]);
    for (Eigen::Index k = 0; k < weight_.size(); ++k) {
      system_.add_square(at(k).first, at(k).coefficients, stiffness_[k]);
    }
    factor_.factorize(system_.lower());
    return factor_.info() == Eigen::Success;
  }

  /// The step that changes the products by `targets`, to first order.
  [[nodiscard]] Step solve(const Array& targets) const {
    const Eigen::Index hinges = weight_.size(), n = x_.size();
    const Array of_margin = targets.head(hinges), of_slack = targets.segment(hinges, hinges);
    const Array of_lower = targets.segment(2 * hinges, n), of_upper = targets.tail(n);
    const Array to_lower = x_.array() - lower_, to_upper = upper_ - x_.array();
    const Array rest = weight_ - multiplier_;
    const Array pulls = of_margin / multiplier_ - of_slack / rest;
    Vector rhs = -dual_residual() + (of_lower / to_lower - of_upper / to_upper).matrix();
    add_transposed(stiffness_ * pulls, rhs);
    Step step;
    step.x = Vector(factor_.solve(rhs)).array();
    const Array along = times_a(step.x);
    step.multiplier = stiffness_ * (pulls - along);
    step.slack = (of_slack + slack_ * step.multiplier) / rest;
    step.margin = along + step.slack;
    step.below = (of_lower - below_ * step.x) / to_lower;
    step.above = (of_upper + above_ * step.x) / to_upper;
    step.corrections = joined(step.margin * step.multiplier, -step.slack * step.multiplier,
                              step.x * step.below, -step.x * step.above);
    step.primal = std::min({longest(margin_, step.margin), longest(slack_, step.slack),
                            longest(to_lower, step.x), longest(to_upper, -step.x)});
    step.dual = std::min({longest(multiplier_, step.multiplier), longest(rest, -step.multiplier),
                          longest(below_, step.below), longest(above_, step.above)});
    return step;
  }

  const PenaltyQp& qp_;
  std::vector<const Hinge*> hinges_;
  BandMatrix system_;
  Vector x_;
  Array lower_, upper_, weight_;
  Array slack_, margin_;  ///< t, and t - (bound - a x).
  Array multiplier_;      ///< Of the margins; what is left of the weight is that of the slacks.
  Array below_, above_;   ///< Multipliers of the bounds.
  Array stiffness_;       ///< W.
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>>
      factor_;
};

}  // namespace

BandMatrix::BandMatrix(int blocks, int width, int reach) : lower_(blocks * width, blocks * width) {
  const int size = blocks * width;
  const int below = std::min(size - 1, (reach + 1) * width - 1);
  lower_.reserve(Eigen::VectorXi::Constant(size, below + 1));
  for (int column = 0; column < size; ++column) {
    for (int row = column; row <= std::min(column + below, size - 1); ++row) {
      lower_.insert(row, column) = 0.0;
    }
  }
  lower_.makeCompressed();
}

void BandMatrix::add(int row, int column, double value) noexcept {
  if (row < column) std::swap(row, column);
  lower_.valuePtr()[lower_.outerIndexPtr()[column] + row - column] += value;
}

void BandMatrix::add_square(int first, std::span<const double> a, double weight) noexcept {
  for (std::size_t j = 0; j < a.size(); ++j) {
    if (a[j] == 0.0) continue;
    double* column = lower_.valuePtr() + lower_.outerIndexPtr()[first + static_cast<int>(j)];
    const double factor = weight * a[j];
    for (std::size_t i = j; i < a.size(); ++i) column[i - j] += factor * a[i];
  }
}

Eigen::VectorXd BandMatrix::times(const Eigen::VectorXd& x) const {
  return lower_.selfadjointView<Eigen::Lower>() * x;
}

double Hinge::shortfall(const Eigen::VectorXd& x) const noexcept {
  double sum = bound;
  for (std::size_t i = 0; i < coefficients.size(); ++i) {
    sum -= coefficients[i] * x[first + static_cast<Eigen::Index>(i)];
  }
  return sum;
}

double PenaltyQp::value(const Eigen::VectorXd& x) const {
  double sum = 0.5 * x.dot(h.times(x)) + g.dot(x);
  for (const Hinge& hinge : hinges) sum += hinge.weight * std::max(0.0, hinge.shortfall(x));
  return sum;
}

std::optional<Eigen::VectorXd> minimise(const PenaltyQp& qp) {
  InteriorPoint iterate(qp);
  for (int i = 0; i < kMostSteps && !iterate.is_done(); ++i) {
    if (!iterate.step()) return std::nullopt;
  }
  return iterate.x().cwiseMax(qp.lower).cwiseMin(qp.upper);
}

}  // namespace sidestep
