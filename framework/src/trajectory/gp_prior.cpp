#include <sidestep/trajectory/gp_prior.hpp>

#include <cmath>
#include <utility>

#include "hermite.hpp"

namespace sidestep {

GpPrior::GpPrior(Eigen::VectorXd qc, double dt_s) : qc_(std::move(qc)), dt_s_(dt_s) {
  // Q(dt)^-1 = [[12/dt^3, -6/dt^2], [-6/dt^2, 4/dt]] for Qc = 1.
  whitening_ << std::sqrt(12.0 / (dt_s * dt_s * dt_s)), -std::sqrt(3.0 / dt_s),  //
      0.0, std::sqrt(1.0 / dt_s);
}

GpPrior::Interpolation GpPrior::interpolation(double fraction) const noexcept {
  // Lambda(s) and Psi(s) multiplied out are the cubic Hermite basis: Qc cancels.
  const auto basis = detail::hermite_basis(dt_s_, fraction);
  Interpolation at;
  at.lambda << 1.0 - basis.rise, basis.out, -basis.rise_rate, basis.out_rate;
  at.psi << basis.rise, basis.in, basis.rise_rate, basis.in_rate;
  return at;
}

}  // namespace sidestep
