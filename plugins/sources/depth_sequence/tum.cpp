#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "sequence.hpp"
#include "word_lines.hpp"

namespace sidestep::depth_sequence {
namespace {

struct TimedPose {
  double time_s = 0.0;
  Eigen::Vector3d translation_m;
  Eigen::Quaterniond rotation;
};

Result<double> number(const std::string& word, const std::string& where) {
  char* end = nullptr;
  const double value = std::strtod(word.c_str(), &end);
  if (end != word.c_str() + word.size()) {
    return fail(ErrorCode::kConfig, "expected a number, found '" + word + "'", where);
  }
  return value;
}

Result<double> time(const std::string& word, const std::string& where) {
  auto value = number(word, where);
  // Stamps hold nanoseconds in 64 bits.
  if (value && !(std::abs(*value) < 9e9)) {
    return fail(ErrorCode::kConfig, "'" + word + "' is no time in seconds", where);
  }
  return value;
}

Result<std::vector<SequenceEntry>> read_depth_list(const std::filesystem::path& folder) {
  std::vector<SequenceEntry> entries;
  SIDESTEP_TRY(recorded_frames::for_each_line(
      folder / "depth.txt",
      [&](const std::vector<std::string>& words, const std::string& where) -> Result<void> {
        if (words.size() != 2) {
          return fail(ErrorCode::kConfig, "expected a timestamp and a file name", where);
        }
        const auto at_s = SIDESTEP_TRY(time(words[0], where));
        entries.push_back({static_cast<std::int64_t>(entries.size()), Stamp::from_seconds(at_s),
                           folder / words[1]});
        return {};
      }));
  std::ranges::stable_sort(entries, {}, &SequenceEntry::stamp);
  return entries;
}

Result<std::vector<TimedPose>> read_poses(const std::filesystem::path& file) {
  std::vector<TimedPose> poses;
  auto read = recorded_frames::for_each_line(
      file, [&](const std::vector<std::string>& words, const std::string& where) -> Result<void> {
        if (words.size() != 8) {
          return fail(ErrorCode::kConfig, "expected 'timestamp tx ty tz qx qy qz qw'", where);
        }
        const auto at_s = SIDESTEP_TRY(time(words[0], where));
        std::array<double, 7> values{};
        for (std::size_t i = 0; i < values.size(); ++i) {
          values[i] = SIDESTEP_TRY(number(words[i + 1], where));
        }
        poses.push_back({at_s,
                         {values[0], values[1], values[2]},
                         Eigen::Quaterniond(values[6], values[3], values[4], values[5])});
        return {};
      });
  if (!read) return error_of(read);
  std::ranges::stable_sort(poses, {}, &TimedPose::time_s);
  return poses;
}

bool usable(const TimedPose& pose) {
  return pose.translation_m.allFinite() && std::abs(pose.rotation.norm() - 1.0) < 1e-2;
}

class Tum final : public Sequence {
 public:
  Tum(std::vector<SequenceEntry> entries, std::vector<TimedPose> poses, std::string pose_file,
      double max_gap_s)
      : entries_(std::move(entries)),
        poses_(std::move(poses)),
        pose_file_(std::move(pose_file)),
        max_gap_s_(max_gap_s) {}

  [[nodiscard]] std::string_view layout() const override { return "tum"; }
  [[nodiscard]] LayoutDefaults defaults() const override {
    return {.depth_scale = 5000.0, .focal_px = 525.0, .cx_px = 319.5, .cy_px = 239.5};
  }
  [[nodiscard]] const std::vector<SequenceEntry>& entries() const override { return entries_; }

  [[nodiscard]] Result<Transform> T_sequence_camera(const SequenceEntry& entry) const override {
    const double at_s = entry.stamp.seconds();
    const auto bad = [&](const std::string& what) {
      return fail(ErrorCode::kBadFrame, what + std::to_string(at_s) + " s", pose_file_);
    };
    // Within a nanosecond a depth stamp and a pose's time are the same.
    const auto after = std::ranges::lower_bound(poses_, at_s - 1e-9, {}, &TimedPose::time_s);
    if (after == poses_.end()) return bad("the poses end before ");
    if (std::abs(after->time_s - at_s) <= 1e-9) {
      return usable(*after) ? Result<Transform>(rigid(after->translation_m, after->rotation))
                            : bad("there is no usable pose at ");
    }
    if (after == poses_.begin()) return bad("the poses begin after ");
    const auto before = std::prev(after);
    const double gap_s = after->time_s - before->time_s;
    if (gap_s > max_gap_s_) {
      return bad("a gap of " + std::to_string(gap_s) + " s, longer than max_pose_gap_s, at ");
    }
    if (!usable(*before) || !usable(*after)) return bad("there is no usable pose around ");
    const double s = (at_s - before->time_s) / gap_s;
    return rigid((1.0 - s) * before->translation_m + s * after->translation_m,
                 before->rotation.normalized().slerp(s, after->rotation.normalized()));
  }

 private:
  static Transform rigid(const Eigen::Vector3d& translation_m, const Eigen::Quaterniond& rotation) {
    Transform transform = Transform::Identity();
    transform.translation() = translation_m;
    transform.linear() = rotation.normalized().toRotationMatrix();
    return transform;
  }

  std::vector<SequenceEntry> entries_;
  std::vector<TimedPose> poses_;
  std::string pose_file_;
  double max_gap_s_;
};

}  // namespace

Result<std::unique_ptr<Sequence>> open_tum(const Options& options, Log&) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(options.path / "depth.txt", ignored)) {
    return std::unique_ptr<Sequence>();
  }
  auto entries = SIDESTEP_TRY(read_depth_list(options.path));
  if (entries.empty()) return std::unique_ptr<Sequence>();
  const auto pose_file = options.path / "groundtruth.txt";
  auto poses = SIDESTEP_TRY(read_poses(pose_file));
  return std::unique_ptr<Sequence>(std::make_unique<Tum>(
      std::move(entries), std::move(poses), pose_file.string(), options.max_pose_gap_s));
}

}  // namespace sidestep::depth_sequence
