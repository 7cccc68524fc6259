#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep::fake_hsr {

/// A part of the robot that falls silent for a while, in seconds since the first command.
struct Silence {
  std::string part;  ///< One of kParts.
  double from_s = 0.0;
  double until_s = 0.0;  ///< Infinity: for good.
};

/// Those that can.
[[nodiscard]] const std::vector<std::string>& parts();

/// `PART@FROM` or `PART@FROM+FOR`, e.g. `camera@5+3`. Fails with kInvalidArgument.
[[nodiscard]] Result<Silence> parse_silence(const std::string& text);

[[nodiscard]] bool is_silent(const std::vector<Silence>& silences, const std::string& part,
                             std::optional<double> since_command_s);

/// What the command line says.
struct Settings {
  std::filesystem::path scene;
  std::string profile = "hsr";
  std::string prefix = "/hsrb";
  std::string pose = "go";
  std::vector<std::string> joints;  ///< NAME=VALUE, over the pose.
  std::int64_t seed = 0;
  double state_rate_hz = 100.0;
  double camera_rate_hz = 15.0;
  int width_px = 320;
  int height_px = 240;
  double focal_px = 277.0;  ///< 60 x 47 degrees.
  std::string encoding = "16UC1";
  bool clouds = false;  ///< Point clouds beside the images.
  double range_max_m = 5.0;
  bool is_ideal = false;    ///< Exact depth at once, drives that do as told, odometry that is true.
  bool scene_waits = true;  ///< The scene moves from the first command on.
  std::vector<std::string> silences;
  std::vector<std::string> allowed{"base_link:floor"};
  std::filesystem::path summary;

  [[nodiscard]] CameraIntrinsics camera() const {
    return {width_px, height_px, focal_px, focal_px, 0.5 * (width_px - 1), 0.5 * (height_px - 1)};
  }
};

}  // namespace sidestep::fake_hsr
