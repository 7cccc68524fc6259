#include <cmath>
#include <cstdio>
#include <numbers>

#include "triangles.hpp"

namespace sidestep::scene_meshes {
namespace {

constexpr double kDuration_s = 142.0;
constexpr double kSpacing_s = 0.5;
constexpr double kRounds = 3.0;

/// The sway of a hand: a few waves whose periods have nothing in common.
double sway(double time_s, double phase) {
  return 0.5 * std::sin(2.0 * std::numbers::pi * time_s / 3.7 + phase) +
         0.3 * std::sin(2.0 * std::numbers::pi * time_s / 1.9 + 2.3 * phase) +
         0.2 * std::sin(2.0 * std::numbers::pi * time_s / 1.3 + 4.1 * phase);
}

/// Where the camera is: around the middle of the room, higher and lower, nearer and farther.
Eigen::Vector3d position_m(double time_s) {
  const double angle = -2.2 + 2.0 * std::numbers::pi * kRounds * time_s / kDuration_s;
  const double reach = 1.0 - 0.06 * (1.0 + std::sin(2.0 * std::numbers::pi * time_s / 31.0));
  return {
      2.2 * reach * std::cos(angle) + 0.02 * sway(time_s, 0.0),
      1.8 * reach * std::sin(angle) + 0.02 * sway(time_s, 1.0),
      1.25 + 0.35 * std::sin(2.0 * std::numbers::pi * time_s / 23.0) + 0.015 * sway(time_s, 2.0)};
}

/// A point 1.5 m ahead: mostly towards the middle, swinging to both sides, up and down.
Eigen::Vector3d look_at_m(double time_s) {
  const Eigen::Vector3d from = position_m(time_s);
  const double inwards = std::atan2(-from.y(), -from.x());
  const double yaw =
      inwards + 0.75 * std::sin(2.0 * std::numbers::pi * time_s / 17.0) + 0.04 * sway(time_s, 3.0);
  const double pitch = -0.22 + 0.22 * std::sin(2.0 * std::numbers::pi * time_s / 11.0) -
                       0.25 * (from.z() - 1.25) + 0.03 * sway(time_s, 4.0);
  return from + 1.5 * Eigen::Vector3d(std::cos(pitch) * std::cos(yaw),
                                      std::cos(pitch) * std::sin(yaw), std::sin(pitch));
}

}  // namespace

std::string handheld_path() {
  std::string text;
  for (int i = 0; i * kSpacing_s <= kDuration_s; ++i) {
    const double time_s = i * kSpacing_s;
    const Eigen::Vector3d p = position_m(time_s), at = look_at_m(time_s);
    char line[160];
    std::snprintf(line, sizeof line,
                  "    - {time_s: %.1f, position_m: [%.3f, %.3f, %.3f], look_at_m: [%.3f, %.3f, "
                  "%.3f]}\n",
                  time_s, p.x(), p.y(), p.z(), at.x(), at.y(), at.z());
    text += line;
  }
  return text;
}

}  // namespace sidestep::scene_meshes
