#include "poses.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>

#include "word_lines.hpp"

namespace sidestep::pcd {
namespace {

std::optional<double> finite_number(const std::string& text) {
  double value = 0.0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc{} || stop != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

Result<StampedPose> read_pose(const std::vector<std::string>& words, const std::string& where) {
  constexpr std::size_t kWords = 8;
  if (words.size() != kWords) {
    return fail(
        ErrorCode::kConfig,
        "expected 'stamp tx ty tz qx qy qz qw', found " + std::to_string(words.size()) + " values",
        where);
  }
  const auto stamp = SIDESTEP_TRY(read_stamp(words[0], where));
  std::array<double, kWords> values{};
  for (std::size_t i = 1; i < kWords; ++i) {
    const auto value = finite_number(words[i]);
    if (!value) {
      return fail(ErrorCode::kConfig, "expected a finite number, found '" + words[i] + "'", where);
    }
    values[i] = *value;
  }
  const Eigen::Quaterniond rotation(values[7], values[4], values[5], values[6]);
  if (std::abs(rotation.norm() - 1.0) > 1e-2) {
    return fail(ErrorCode::kConfig,
                "the quaternion qx qy qz qw has the length " + std::to_string(rotation.norm()) +
                    ", expected 1",
                where);
  }
  StampedPose pose{stamp};
  pose.T_world_sensor.translation() = Eigen::Vector3d(values[1], values[2], values[3]);
  pose.T_world_sensor.linear() = rotation.normalized().toRotationMatrix();
  return pose;
}

}  // namespace

Result<Stamp> read_stamp(const std::string& text, const std::string& where) {
  constexpr double kLargest_s = 9e9;  // stamps hold nanoseconds in 64 bits
  const auto seconds = finite_number(text);
  if (!seconds || std::abs(*seconds) > kLargest_s) {
    return fail(ErrorCode::kConfig, "'" + text + "' is no time in seconds", where);
  }
  return Stamp::from_seconds(*seconds);
}

Result<std::vector<StampedPose>> read_poses(const std::filesystem::path& file) {
  std::vector<StampedPose> poses;
  auto read = recorded_frames::for_each_line(
      file, [&](const std::vector<std::string>& words, const std::string& where) -> Result<void> {
        poses.push_back(SIDESTEP_TRY(read_pose(words, where)));
        return {};
      });
  if (read) return poses;
  if (read.error().code == ErrorCode::kNotFound) {
    return fail(ErrorCode::kNotFound, "there is no such file of poses", file.string(),
                "set source.poses");
  }
  return error_of(read);
}

}  // namespace sidestep::pcd
