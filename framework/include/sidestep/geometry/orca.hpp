#pragma once

#include <span>

#include <Eigen/Core>

#include <sidestep/core/export.hpp>

namespace sidestep {

/// A disc that moves in the plane: a person, or the robot as people see it. World frame.
struct OrcaAgent {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
};

/// A wall seen from one agent: the nearest point of what stands, outside which it keeps.
struct OrcaWall {
  Eigen::Vector2d nearest_m = Eigen::Vector2d::Zero();
};

struct OrcaSettings {
  double neighbour_distance_m = 10.0;
  int neighbours = 10;     ///< Nearest ones that count.
  double horizon_s = 5.0;  ///< For which velocities must be free of collisions.
  double wall_horizon_s = 1.0;
  double step_s = 0.25;  ///< In which agents that overlap come apart.
};

/// The velocity nearest to the preferred one, no faster than `max_speed_mps`, with which an agent
/// does its half of keeping clear of the others for the horizon (van den Berg, Guy, Lin and
/// Manocha, "Reciprocal n-body collision avoidance", 2011); where there is none, the one that
/// breaks their half planes the least. Deterministic; allocates. [any]
[[nodiscard]] SIDESTEP_EXPORT Eigen::Vector2d orca_velocity(const OrcaAgent& self,
                                                            const Eigen::Vector2d& preferred_mps,
                                                            double max_speed_mps,
                                                            std::span<const OrcaAgent> others,
                                                            std::span<const OrcaWall> walls,
                                                            const OrcaSettings& settings);

}  // namespace sidestep
