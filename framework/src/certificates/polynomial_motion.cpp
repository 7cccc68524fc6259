#include <sidestep/certificates/polynomial_motion.hpp>

namespace sidestep {

std::array<double, PolynomialPiece::kTerms> cubic(double from, double from_speed, double to,
                                                  double to_speed, double span_s) {
  const double mean = (to - from) / span_s;
  return {from, from_speed, (3.0 * mean - 2.0 * from_speed - to_speed) / span_s,
          (from_speed + to_speed - 2.0 * mean) / (span_s * span_s)};
}

PolynomialMotion polynomials_of(const Trajectory& trajectory) {
  PolynomialMotion motion;
  motion.joining = Joining::kCubic;
  for (int k = 0; k + 1 < trajectory.size(); ++k) {
    const double begin_s = trajectory.times_s[static_cast<std::size_t>(k)];
    const double end_s = trajectory.times_s[static_cast<std::size_t>(k) + 1];
    PolynomialPiece piece{begin_s, end_s, {}};
    for (std::size_t j = 0; j < static_cast<std::size_t>(trajectory.dof); ++j) {
      piece.coefficients.push_back(cubic(trajectory.q(k)[j], trajectory.qdot(k)[j],
                                         trajectory.q(k + 1)[j], trajectory.qdot(k + 1)[j],
                                         end_s - begin_s));
    }
    motion.pieces.push_back(std::move(piece));
  }
  return motion;
}

}  // namespace sidestep
