#pragma once

#include <filesystem>
#include <vector>

#include <sidestep/certificates/certify.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// What a check by shapes looks at, as what certify() does: the floor becomes an object, occupied
/// voxels a swarm of cubes.
[[nodiscard]] SIDESTEP_EXPORT CertifiedScene
certified_scene(const ShapeObstacles& obstacles, std::vector<AllowedContact> allowed = {});

/// Certifies a plan among what it was checked against and leaves the certificate of one that is
/// proven in `file`, whose folder is made. Of a scene in which something moves nothing is asked.
/// Fails with kUnsupported for a robot that does not tell its joints (KinematicTree), with kIo
/// where the file cannot be written, and as certify() does.
[[nodiscard]] SIDESTEP_EXPORT Result<Certification::Outcome> leave_certificate(
    const RobotModel& robot, const ShapeObstacles& obstacles, std::vector<AllowedContact> allowed,
    const Trajectory& plan, const std::filesystem::path& file);

}  // namespace sidestep
