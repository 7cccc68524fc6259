#include "pcd_source.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <sidestep/core/seed.hpp>

#include "chosen_frames.hpp"
#include "cloud_filters.hpp"
#include "pcd_file.hpp"
#include "poses.hpp"

namespace sidestep::pcd {
namespace {

/// One cloud of the sequence.
struct Entry {
  std::int64_t number = 0;  ///< Among all files, from 0.
  std::filesystem::path file;
  Stamp stamp;
  std::optional<Transform> T_world_sensor;  ///< From the file of poses.
};

/// From a sensor's frame with x forward and z up to its optical one.
Transform T_forward_optical() {
  Transform transform = Transform::Identity();
  transform.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return transform;
}

class PcdSource final : public Source {
 public:
  PcdSource(Options options, std::vector<Entry> entries, std::uint64_t seed)
      : options_(std::move(options)), entries_(std::move(entries)), seed_(seed) {}

  Result<std::optional<Frame>> next(const Deadline& deadline) override {
    if (deadline.stop_requested()) return fail(ErrorCode::kCancelled, "reading was cancelled");
    if (at_ >= entries_.size()) return std::optional<Frame>();
    if (deadline.expired()) {
      return fail(ErrorCode::kDeadlineExceeded, "no time was left to read a cloud");
    }
    const std::size_t index = at_++;
    const Entry& entry = entries_[index];
    auto frame = read(entry, static_cast<std::int64_t>(index));
    if (!frame) {
      Error error = std::move(frame.error());
      const std::string file = error.where.empty() ? entry.file.string() : error.where;
      error.where = "frame " + std::to_string(entry.number) + " (" + file + ")";
      return tl::make_unexpected(std::move(error));
    }
    return std::optional<Frame>(std::move(*frame));
  }

  std::optional<std::int64_t> frame_count() const override {
    return static_cast<std::int64_t>(entries_.size());
  }

 private:
  [[nodiscard]] Result<Frame> read(const Entry& entry, std::int64_t index) const {
    auto cloud = SIDESTEP_TRY(read_pcd(entry.file));
    const auto pose = SIDESTEP_TRY(pose_of(entry, cloud));
    Frame frame;
    frame.sequence = index;
    frame.stamp = entry.stamp;
    frame.T_world_camera = pose;
    if (options_.points_in == "forward") frame.T_world_camera = pose * T_forward_optical();
    turn_to_optical(frame.T_world_camera, cloud.points_m);
    const std::uint64_t seed = derive_seed(seed_, "cloud " + std::to_string(entry.number));
    auto points = SIDESTEP_TRY(
        apply_filters(options_.filters, std::move(cloud.points_m), frame.T_world_camera, seed));
    frame.measurement = PointCloud{std::move(points)};
    return frame;
  }

  [[nodiscard]] Result<Transform> pose_of(const Entry& entry, const PcdCloud& cloud) const {
    if (options_.poses) {
      if (entry.T_world_sensor) return *entry.T_world_sensor;
      return fail(ErrorCode::kBadFrame, "no pose within max_pose_offset_s of " +
                                            std::to_string(entry.stamp.seconds()) + " s in " +
                                            options_.poses->string());
    }
    if (cloud.T_world_sensor) return *cloud.T_world_sensor;
    return fail(ErrorCode::kBadFrame, "no pose: the file has no VIEWPOINT", {},
                "set source.poses to a file of poses");
  }

  void turn_to_optical(const Transform& T_world_camera,
                       std::vector<Eigen::Vector3f>& points_m) const {
    if (options_.points_in == "optical") return;
    const Transform T_camera_points =
        options_.points_in == "forward" ? T_forward_optical().inverse() : T_world_camera.inverse();
    for (Eigen::Vector3f& p : points_m) p = (T_camera_points * p.cast<double>()).cast<float>();
  }

  Options options_;
  std::vector<Entry> entries_;
  std::uint64_t seed_;
  std::size_t at_ = 0;
};

Result<std::vector<Entry>> find_clouds(const Options& options) {
  std::error_code ignored;
  std::vector<std::filesystem::path> files;
  if (std::filesystem::is_directory(options.path, ignored)) {
    for (const auto& item : std::filesystem::directory_iterator(options.path, ignored)) {
      if (item.path().extension() == ".pcd") files.push_back(item.path());
    }
    if (files.empty()) {
      return fail(ErrorCode::kNotFound, "the folder holds no .pcd file", options.path.string());
    }
    std::ranges::sort(files);
  } else if (std::filesystem::is_regular_file(options.path, ignored)) {
    files.push_back(options.path);
  } else {
    return fail(ErrorCode::kNotFound, "there is no such file or folder of point clouds",
                options.path.string(), "set source.path");
  }
  std::vector<Entry> entries;
  for (std::filesystem::path& file : files) {
    const auto number = static_cast<std::int64_t>(entries.size());
    const Stamp stamp = Stamp::from_seconds(static_cast<double>(number) / options.rate_hz);
    entries.push_back({number, std::move(file), stamp, std::nullopt});
  }
  return entries;
}

/// Line by line.
Result<void> match_in_order(const Options& options, const std::vector<StampedPose>& poses,
                            std::vector<Entry>& entries) {
  if (poses.size() != entries.size()) {
    return fail(ErrorCode::kConfig,
                "there are " + std::to_string(poses.size()) + " poses for " +
                    std::to_string(entries.size()) + " point clouds",
                options.poses->string(),
                "with source.match: stamp, the clouds' names say which poses are theirs");
  }
  for (std::size_t i = 0; i < entries.size(); ++i) {
    entries[i].stamp = poses[i].stamp;
    entries[i].T_world_sensor = poses[i].T_world_sensor;
  }
  return {};
}

/// The nearest in time. What is too far off is left without a pose.
Result<void> match_by_stamp(const Options& options, std::vector<StampedPose> poses,
                            std::vector<Entry>& entries) {
  std::ranges::stable_sort(poses, {}, &StampedPose::stamp);
  for (Entry& entry : entries) {
    const auto stamp = read_stamp(entry.file.stem().string(), entry.file.string());
    if (!stamp) {
      Error error = stamp.error();
      error.hint = "with source.match: stamp, files are named by their time, as 12.345.pcd";
      return tl::make_unexpected(std::move(error));
    }
    entry.stamp = *stamp;
    const auto offset_s = [&](auto pose) {
      return std::abs(static_cast<double>(pose->stamp.ns - stamp->ns)) * 1e-9;
    };
    auto nearest = std::ranges::lower_bound(poses, *stamp, {}, &StampedPose::stamp);
    if (nearest != poses.begin() &&
        (nearest == poses.end() || offset_s(std::prev(nearest)) <= offset_s(nearest))) {
      --nearest;
    }
    if (nearest != poses.end() && offset_s(nearest) <= options.max_pose_offset_s) {
      entry.T_world_sensor = nearest->T_world_sensor;
    }
  }
  std::ranges::stable_sort(entries, {}, &Entry::stamp);
  return {};
}

}  // namespace

Result<std::unique_ptr<Source>> create_source(const Options& options, std::uint64_t seed) {
  auto entries = SIDESTEP_TRY(find_clouds(options));
  if (options.poses) {
    auto poses = SIDESTEP_TRY(read_poses(*options.poses));
    SIDESTEP_TRY(options.match == "order" ? match_in_order(options, poses, entries)
                                          : match_by_stamp(options, std::move(poses), entries));
  }
  auto selected = SIDESTEP_TRY(recorded_frames::chosen_frames(
      std::move(entries), options, "point clouds", options.path.string()));
  return std::unique_ptr<Source>(std::make_unique<PcdSource>(options, std::move(selected), seed));
}

}  // namespace sidestep::pcd
