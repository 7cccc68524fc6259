#include "pcd_source.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>

#include <sidestep/core/error.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/geometry/transform.hpp>

#include "cloud_filters.hpp"
#include "pcd_file.hpp"
#include "recorded_frames.hpp"

namespace sidestep::pcd {
namespace {

struct StampedPose {
  Stamp stamp;
  Transform T_world_sensor = Transform::Identity();
};

/// The poses of a file with 'stamp tx ty tz qx qy qz qw' a line (Sturm et al. 2012), in the order
/// of the file; lines that are empty or begin with # are skipped. Fails with kNotFound, or with
/// kConfig at file:line.
[[nodiscard]] Result<std::vector<StampedPose>> read_poses(const std::filesystem::path& file);

/// A time in seconds, of at most 285 years. Fails with kConfig.
[[nodiscard]] Result<Stamp> read_stamp(const std::string& text, const std::string& where);

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

/// One cloud of the sequence.
struct Entry {
  std::int64_t number = 0;  ///< Among all files, from 0.
  std::filesystem::path file;
  Stamp stamp;
  std::optional<Transform> T_world_sensor;  ///< From the file of poses.
};

class PcdSource final : public Source {
 public:
  PcdSource(Options options, std::vector<Entry> entries, std::uint64_t seed, Log& log)
      : options_(std::move(options)),
        entries_(std::move(entries)),
        seed_(seed),
        tally_(log, options_.path.string(), entries_.size()) {}

  Result<std::optional<Frame>> next(const Deadline& deadline) override {
    if (deadline.stop_requested()) return fail(ErrorCode::kCancelled, "reading was cancelled");
    if (at_ >= entries_.size()) {
      tally_.tell();
      return std::optional<Frame>();
    }
    if (deadline.expired()) {
      return fail(ErrorCode::kDeadlineExceeded, "no time was left to read a cloud");
    }
    const std::size_t index = at_++;
    const Entry& entry = entries_[index];
    auto frame = read(entry, static_cast<std::int64_t>(index));
    tally_.count_frame(frame.has_value());
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
  [[nodiscard]] Result<Frame> read(const Entry& entry, std::int64_t index) {
    auto cloud = SIDESTEP_TRY(read_pcd(entry.file));
    tally_.count_left_out("points are not finite", cloud.not_finite);
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
  recorded_frames::FrameTally tally_;
  std::size_t at_ = 0;
};

Result<std::vector<Entry>> find_clouds(const Options& options, Log& log) {
  std::error_code ignored;
  std::vector<std::filesystem::path> files;
  std::size_t others = 0;
  if (std::filesystem::is_directory(options.path, ignored)) {
    for (const auto& item : std::filesystem::directory_iterator(options.path, ignored)) {
      if (item.path().extension() == ".pcd") {
        files.push_back(item.path());
      } else {
        ++others;
      }
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
  log.debug("read " + options.path.string() + ": " + std::to_string(files.size()) +
            " point clouds, " + std::to_string(others) + " other files");
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
    if (i > 0 && poses[i].stamp <= poses[i - 1].stamp) {
      return fail(ErrorCode::kConfig,
                  "pose " + std::to_string(i) + " is not later than the one before",
                  options.poses->string(), "poses are in the order of the clouds, and of time");
    }
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

Parameters<VoxelFilter> VoxelFilter::parameters() {
  return Parameters<VoxelFilter>().add("leaf_m", &VoxelFilter::leaf_m, "Edge of the cube.",
                                       {.unit = "m", .min = 1e-4});
}

Parameters<OutlierFilter> OutlierFilter::parameters() {
  using F = OutlierFilter;
  return Parameters<F>()
      .add("neighbours", &F::neighbours, "How many nearest points are looked at.", {.min = 1})
      .add("deviations", &F::deviations,
           "A point is dropped when its mean distance to them exceeds the mean of all points by "
           "this many standard deviations.",
           {.min = 0.0});
}

Parameters<CropFilter> CropFilter::parameters() {
  using F = CropFilter;
  return Parameters<F>()
      .add("min_m", &F::min_m, "Lower corner of the box.", {.unit = "m", .required = true})
      .add("max_m", &F::max_m, "Upper corner of the box.", {.unit = "m", .required = true})
      .add("frame", &F::frame, "Frame of the box; camera: the optical frame.",
           {.choices = {"world", "camera"}})
      .add("keep", &F::keep, "Which points stay.", {.choices = {"inside", "outside"}});
}

Parameters<PlaneFilter> PlaneFilter::parameters() {
  using F = PlaneFilter;
  return Parameters<F>()
      .add("distance_m", &F::distance_m, "Points this near to the plane belong to it.",
           {.unit = "m", .min = 1e-5})
      .add("min_share", &F::min_share,
           "A plane with a smaller share of the points is left in the cloud.",
           {.min = 0.0, .max = 1.0})
      .add("iterations", &F::iterations, "Planes tried at most.", {.min = 1});
}

Parameters<Filter> Filter::parameters() {
  return Parameters<Filter>()
      .add("voxel", &Filter::voxel, "One point, the mean, for all points in a cube.")
      .add("outlier", &Filter::outlier, "Drops points whose neighbours are far away.")
      .add("crop", &Filter::crop, "Keeps the points in a box, or those outside.")
      .add("plane", &Filter::plane, "Removes the points of the largest plane.");
}

Parameters<Options> Options::parameters() {
  using O = Options;
  return Parameters<O>()
      .add("path", &O::path, "A .pcd file, or a folder of them, taken in the order of their names.",
           {.required = true})
      .add("poses", &O::poses,
           "File of poses of the sensor, 'stamp tx ty tz qx qy qz qw' a line; null: each file's "
           "VIEWPOINT.")
      .add("match", &O::match,
           "Which line of poses is whose; order: one line a file, in order; stamp: the nearest to "
           "the file's name, read as seconds.",
           {.choices = {"order", "stamp"}})
      .add("max_pose_offset_s", &O::max_pose_offset_s,
           "With match stamp, how far the nearest pose may be from the file.",
           {.unit = "s", .min = 0.0})
      .add("points_in", &O::points_in,
           "Frame of the points; optical: sensor, z forward; forward: sensor, x forward and z up; "
           "world: already placed in the world. Poses are of the sensor's frame with these axes; "
           "for world, of the optical one.",
           {.choices = {"optical", "forward", "world"}})
      .add("first_frame", &O::first_frame, "Files left out at the beginning.", {.min = 0})
      .add("max_frames", &O::max_frames, "Frames handed out at most; 0: all.", {.min = 0})
      .add("stride", &O::stride, "Every how many files one is handed out.", {.min = 1})
      .add("rate_hz", &O::rate_hz, "Frames a second, for stamps where poses give none.",
           {.unit = "Hz", .min = 1e-3})
      .add("filters", &O::filters,
           "Applied to each cloud in this order; each item has one key, the filter's name.");
}

std::vector<OptionMistake> Options::check() const {
  std::vector<OptionMistake> mistakes;
  for (std::size_t i = 0; i < filters.size(); ++i) {
    const Filter& filter = filters[i];
    const std::string name = "filters[" + std::to_string(i) + "]";
    const int count = (filter.voxel ? 1 : 0) + (filter.outlier ? 1 : 0) + (filter.crop ? 1 : 0) +
                      (filter.plane ? 1 : 0);
    if (count != 1) {
      mistakes.push_back({{name},
                          "names " + std::to_string(count) + " filters, expected one",
                          "write one item a filter: - voxel: {leaf_m: 0.02}"});
    }
    if (filter.crop && !(filter.crop->min_m.array() < filter.crop->max_m.array()).all()) {
      mistakes.push_back({{name + ".crop.min_m"}, "must be below max_m along each axis", {}});
    }
  }
  if (match == "stamp" && !poses) {
    mistakes.push_back({{"match"}, "is stamp, but poses is not set", {}});
  }
  return mistakes;
}

Result<std::unique_ptr<Source>> create_source(const Options& options, std::uint64_t seed,
                                              Log& log) {
  auto entries = SIDESTEP_TRY(find_clouds(options, log));
  const std::size_t all = entries.size();
  if (options.poses) {
    auto poses = SIDESTEP_TRY(read_poses(*options.poses));
    log.debug("read " + options.poses->string() + ": " + std::to_string(poses.size()) + " poses");
    SIDESTEP_TRY(options.match == "order" ? match_in_order(options, poses, entries)
                                          : match_by_stamp(options, std::move(poses), entries));
  }
  auto selected = SIDESTEP_TRY(recorded_frames::chosen_frames(
      std::move(entries), options, "point clouds", options.path.string()));
  if (selected.size() < all) {
    log.warn("hands out " + std::to_string(selected.size()) + " of " + std::to_string(all) +
             " point clouds, as first_frame, stride and max_frames say");
  }
  return std::unique_ptr<Source>(
      std::make_unique<PcdSource>(options, std::move(selected), seed, log));
}

}  // namespace sidestep::pcd
