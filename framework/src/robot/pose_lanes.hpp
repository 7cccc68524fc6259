#pragma once

#include <Eigen/Core>

#include <sidestep/core/lanes.hpp>

namespace sidestep::detail {

/// The pose of one body in kLanes configurations, value by value.
struct alignas(64) PoseLanes {
  double R[9][kLanes];  ///< Column by column.
  double p[3][kLanes];
};

/// Poses of a frame that is fixed to a body, or to the world where that is null, given its pose in
/// the frame of the body.
void attach(const PoseLanes* body, const Eigen::Matrix3d& R, const Eigen::Vector3d& p,
            PoseLanes& out) noexcept;

/// Turns about the frame's own z, and shifts along it, by what each configuration says.
void turn_about_z(PoseLanes& pose, const double* sines, const double* cosines) noexcept;
void shift_along_z(PoseLanes& pose, const double* way) noexcept;

/// Where a point fixed to a body is.
void carry(const PoseLanes& body, const Eigen::Vector3d& p, PointLanes& out) noexcept;

}  // namespace sidestep::detail
