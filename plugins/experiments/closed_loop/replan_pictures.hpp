#pragma once

#include <vector>

#include <Eigen/Core>

#include <sidestep/results/recorder.hpp>
#include "replan_types.hpp"

namespace sidestep {

/// What a shape covers of the ground, seen from above: corners of its convex hull,
/// counter-clockwise; empty for a half-space.
[[nodiscard]] std::vector<Eigen::Vector2d> outline_from_above(const Shape& shape,
                                                              const Transform& T_world_shape);

/// Series "picture/EPISODE", as record_episode() says.
void record_pictures(const EpisodeRecord& episode, const RobotModel& robot, int pictures,
                     Recorder& recorder);

}  // namespace sidestep
