#include "pose_lanes.hpp"

namespace sidestep::detail {
namespace {

/// out = R * v + offset, of column-major R.
[[gnu::always_inline]] inline void multiply(const double (&R)[9][kLanes], const double* v,
                                            double (*out)[kLanes],
                                            const double (*offset)[kLanes]) noexcept {
  for (std::size_t row = 0; row < 3; ++row) {
    Lanes sum = lanes(R[row]) * v[0] + lanes(R[3 + row]) * v[1] + lanes(R[6 + row]) * v[2];
    if (offset != nullptr) sum += lanes(offset[row]);
    lanes(out[row]) = sum;
  }
}

}  // namespace

SIDESTEP_SIMD_CLONES
void attach(const PoseLanes* body, const Eigen::Matrix3d& R, const Eigen::Vector3d& p,
            PoseLanes& out) noexcept {
  if (body == nullptr) {
    for (std::size_t i = 0; i < 9; ++i) lanes(out.R[i]) = Lanes{} + R.data()[i];
    for (std::size_t i = 0; i < 3; ++i) lanes(out.p[i]) = Lanes{} + p.data()[i];
    return;
  }
  for (std::size_t column = 0; column < 3; ++column) {
    multiply(body->R, R.data() + 3 * column, out.R + 3 * column, nullptr);
  }
  multiply(body->R, p.data(), out.p, body->p);
}

SIDESTEP_SIMD_CLONES
void turn_about_z(PoseLanes& pose, const double* sines, const double* cosines) noexcept {
  const Lanes s = lanes(sines), c = lanes(cosines);
  for (std::size_t row = 0; row < 3; ++row) {
    const Lanes x = lanes(pose.R[row]), y = lanes(pose.R[3 + row]);
    lanes(pose.R[row]) = c * x + s * y;
    lanes(pose.R[3 + row]) = c * y - s * x;
  }
}

SIDESTEP_SIMD_CLONES
void shift_along_z(PoseLanes& pose, const double* way) noexcept {
  for (std::size_t row = 0; row < 3; ++row) {
    lanes(pose.p[row]) += lanes(way) * lanes(pose.R[6 + row]);
  }
}

SIDESTEP_SIMD_CLONES
void carry(const PoseLanes& body, const Eigen::Vector3d& p, PointLanes& out) noexcept {
  const auto& R = body.R;
  lanes(out.x) = lanes(R[0]) * p[0] + lanes(R[3]) * p[1] + lanes(R[6]) * p[2] + lanes(body.p[0]);
  lanes(out.y) = lanes(R[1]) * p[0] + lanes(R[4]) * p[1] + lanes(R[7]) * p[2] + lanes(body.p[1]);
  lanes(out.z) = lanes(R[2]) * p[0] + lanes(R[5]) * p[1] + lanes(R[8]) * p[2] + lanes(body.p[2]);
}

}  // namespace sidestep::detail
