#include "sequence.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <map>
#include <optional>
#include <set>
#include <sstream>

#include <Eigen/SVD>

#include <sidestep/core/file.hpp>

#include "recorded_frames.hpp"

namespace sidestep::depth_sequence {
namespace {

constexpr std::string_view kPrefix = "frame-";
constexpr std::string_view kDepthSuffix = ".depth.png";
constexpr std::string_view kPoseSuffix = ".pose.txt";
constexpr double kLargest_s = 9e9;  ///< Stamps hold nanoseconds in 64 bits.

/// The number in "frame-000123.depth.png"; nothing for any other name.
std::optional<std::int64_t> frame_number(std::string_view name, std::string_view suffix) {
  if (!name.starts_with(kPrefix) || !name.ends_with(suffix)) return {};
  if (name.size() <= kPrefix.size() + suffix.size()) return {};
  name = name.substr(kPrefix.size(), name.size() - kPrefix.size() - suffix.size());
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (error != std::errc{} || end != name.data() + name.size() || number < 0) return {};
  return number;
}

class SevenScenes final : public Sequence {
 public:
  explicit SevenScenes(std::vector<SequenceEntry> entries) : entries_(std::move(entries)) {}

  [[nodiscard]] std::string_view layout() const override { return "seven_scenes"; }
  [[nodiscard]] LayoutDefaults defaults() const override {
    return {.depth_scale = 1000.0, .focal_px = 585.0, .cx_px = 320.0, .cy_px = 240.0};
  }
  [[nodiscard]] const std::vector<SequenceEntry>& entries() const override { return entries_; }

  [[nodiscard]] Result<Transform> T_sequence_camera(const SequenceEntry& entry) const override {
    const std::string depth_name = entry.depth_file.filename().string();
    const std::string stem = depth_name.substr(0, depth_name.size() - kDepthSuffix.size());
    const auto file = entry.depth_file.parent_path() / (stem + std::string(kPoseSuffix));
    const auto matrix = read_matrix(file, 4, 4, ErrorCode::kBadFrame);
    if (!matrix) {
      return tl::make_unexpected(Error{ErrorCode::kBadFrame,
                                       "the frame has no usable pose: " + matrix.error().message,
                                       file.string(),
                                       {},
                                       nullptr});
    }
    return rigid_transform(*matrix, ErrorCode::kBadFrame, file.string());
  }

 private:
  std::vector<SequenceEntry> entries_;
};

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
  if (value && !(std::abs(*value) < kLargest_s)) {
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

/// How many images lie beside listed ones and are not listed.
std::size_t unlisted(const std::vector<SequenceEntry>& entries) {
  std::set<std::filesystem::path> listed, folders;
  for (const SequenceEntry& entry : entries) {
    listed.insert(entry.depth_file.lexically_normal());
    folders.insert(entry.depth_file.lexically_normal().parent_path());
  }
  std::size_t count = 0;
  std::error_code error;  // of a folder that is not there, whose frames tell
  for (const std::filesystem::path& folder : folders) {
    for (auto file = std::filesystem::directory_iterator(folder, error);
         !error && file != std::filesystem::directory_iterator(); file.increment(error)) {
      if (file->path().extension() == ".png" && !listed.contains(file->path())) ++count;
    }
  }
  return count;
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

class Open3d final : public Sequence {
 public:
  /// `poses`: of the entries, as far as there are any.
  Open3d(std::vector<SequenceEntry> entries, std::vector<Eigen::Matrix4d> poses,
         std::string pose_file)
      : entries_(std::move(entries)), poses_(std::move(poses)), pose_file_(std::move(pose_file)) {}

  [[nodiscard]] std::string_view layout() const override { return "open3d"; }
  [[nodiscard]] LayoutDefaults defaults() const override {
    return {.depth_scale = 1000.0, .focal_px = 525.0, .cx_px = 319.5, .cy_px = 239.5};
  }
  [[nodiscard]] const std::vector<SequenceEntry>& entries() const override { return entries_; }

  [[nodiscard]] Result<Transform> T_sequence_camera(const SequenceEntry& entry) const override {
    const auto number = static_cast<std::size_t>(entry.number);
    if (number >= poses_.size()) {
      return fail(ErrorCode::kBadFrame,
                  "there are only " + std::to_string(poses_.size()) + " poses", pose_file_);
    }
    return rigid_transform(poses_[number], ErrorCode::kBadFrame, pose_file_);
  }

 private:
  std::vector<SequenceEntry> entries_;
  std::vector<Eigen::Matrix4d> poses_;
  std::string pose_file_;
};

/// Blocks of a line of three whole numbers, of which the first counts, and a 4x4 matrix.
Result<std::vector<Eigen::Matrix4d>> read_trajectory_log(const std::filesystem::path& file) {
  constexpr std::size_t kLines = 5;
  std::vector<Eigen::Matrix4d> poses;
  std::size_t line = 0;
  SIDESTEP_TRY(recorded_frames::for_each_line(
      file, [&](const std::vector<std::string>& words, const std::string& where) -> Result<void> {
        const std::size_t of_block = line++ % kLines;
        if (of_block == 0) poses.emplace_back(Eigen::Matrix4d::Zero());
        const std::size_t expected = of_block == 0 ? 3 : 4;
        if (words.size() != expected) {
          return fail(ErrorCode::kConfig,
                      of_block == 0 ? "expected the three numbers of a pose"
                                    : "expected a row of four numbers",
                      where);
        }
        for (std::size_t k = 0; k < words.size(); ++k) {
          const double value = SIDESTEP_TRY(number(words[k], where));
          if (of_block == 0 && k == 0 && value != static_cast<double>(poses.size() - 1)) {
            return fail(
                ErrorCode::kConfig,
                "this is pose " + words[0] + ", expected " + std::to_string(poses.size() - 1),
                where, "every image of the folder has a pose, from 0 on");
          }
          if (of_block > 0)
            poses.back()(static_cast<int>(of_block) - 1, static_cast<int>(k)) = value;
        }
        return {};
      }));
  if (line % kLines != 0) {
    return fail(ErrorCode::kConfig, "the last pose is cut off", file.string());
  }
  return poses;
}

/// The images of a folder by the numbers that are their names, padded or not.
Result<std::vector<std::filesystem::path>> png_files(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (auto file = std::filesystem::directory_iterator(folder, error);
       !error && file != std::filesystem::directory_iterator(); file.increment(error)) {
    if (file->path().extension() == ".png") files.push_back(file->path());
  }
  if (error) {
    return fail(ErrorCode::kIo, "the folder cannot be read: " + error.message(), folder.string());
  }
  std::ranges::sort(files, {}, [](const std::filesystem::path& file) {
    std::string name = file.stem().string();
    name.erase(0, std::min(name.find_first_not_of('0'), name.size()));
    return std::pair(name.size(), name);
  });
  return files;
}

}  // namespace

Result<std::unique_ptr<Sequence>> open_sequence(const Options& options, Log& log) {
  const std::string folder = options.path.string();
  std::error_code ignored;
  if (!std::filesystem::is_directory(options.path, ignored)) {
    return fail(ErrorCode::kNotFound, "there is no such folder of a depth sequence", folder,
                "set source.path");
  }
  const bool any = options.format == "auto";
  for (const auto& [name, open] :
       {std::pair("seven_scenes", &open_seven_scenes), std::pair("tum", &open_tum),
        std::pair("open3d", &open_open3d)}) {
    if (!any && options.format != name) continue;
    auto sequence = open(options, log);
    if (!sequence || *sequence != nullptr) return sequence;
  }
  return fail(ErrorCode::kNotFound,
              any ? "the folder holds no depth sequence"
                  : "the folder holds no depth sequence of the layout '" + options.format + "'",
              folder,
              "understood are seven_scenes (frame-000000.depth.png with frame-000000.pose.txt), "
              "tum (depth.txt, groundtruth.txt and the images they name) and open3d "
              "(trajectory.log, or scene/trajectory.log, and images in depth)");
}

Result<Transform> rigid_transform(const Eigen::Matrix4d& matrix, ErrorCode code,
                                  const std::string& where) {
  if (!matrix.allFinite()) return fail(code, "the pose has an element that is not finite", where);
  const Eigen::Matrix3d written = matrix.topLeftCorner<3, 3>();
  const double error =
      (written.transpose() * written - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (error > kRotationTolerance || written.determinant() <= 0.0) {
    return fail(code, "the pose's upper left 3x3 block is not a rotation", where);
  }
  if ((matrix.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() > 1e-6) {
    return fail(code, "the pose's last row is not 0 0 0 1", where);
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(written, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Transform transform = Transform::Identity();
  transform.linear() = svd.matrixU() * svd.matrixV().transpose();
  transform.translation() = matrix.topRightCorner<3, 1>();
  return transform;
}

constexpr std::uintmax_t kMostMatrixBytes = 1 << 16;

Result<Eigen::MatrixXd> read_matrix(const std::filesystem::path& file, int rows, int columns,
                                    ErrorCode code) {
  std::istringstream stream(SIDESTEP_TRY(read_file(file, kMostMatrixBytes)));
  const std::string expected =
      "expected " + std::to_string(rows) + " x " + std::to_string(columns) + " numbers";
  Eigen::MatrixXd matrix(rows, columns);
  int count = 0;
  for (std::string word; stream >> word; ++count) {
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);  // reads nan and inf too
    if (end != word.c_str() + word.size()) {
      return fail(code, expected + ", found '" + word + "'", file.string());
    }
    if (count < rows * columns) matrix(count / columns, count % columns) = value;
  }
  if (count != rows * columns) {
    return fail(code, expected + ", found " + std::to_string(count), file.string());
  }
  return matrix;
}

Result<Transform> read_T_world_sequence(const std::filesystem::path& file,
                                        const DocumentReader& documents) {
  const auto document = SIDESTEP_TRY(documents.read(file));
  const std::string key = "T_world_sequence";
  for (const Node::Entry& entry : document.entries()) {
    if (entry.key != key) {
      return tl::make_unexpected(Error{ErrorCode::kConfig, "unknown key '" + entry.key + "'",
                                       entry.key_mark.to_string(), "known here: " + key, nullptr});
    }
  }
  const Node* rows = document.find(key);
  if (rows == nullptr || rows->items().size() != 4) {
    return tl::make_unexpected((rows != nullptr ? *rows : document)
                                   .error("expected " + key + " as a list of 4 rows of 4 numbers"));
  }
  Eigen::Matrix4d matrix;
  for (int row = 0; row < 4; ++row) {
    const auto values = SIDESTEP_TRY(rows->items()[static_cast<std::size_t>(row)].as_doubles(4));
    matrix.row(row) = Eigen::Map<const Eigen::RowVector4d>(values.data());
  }
  return rigid_transform(matrix, ErrorCode::kConfig, rows->mark().to_string());
}

Result<std::unique_ptr<Sequence>> open_seven_scenes(const Options& options, Log& log) {
  // A frame counts if either of its files is there; what is missing is told frame by frame.
  std::map<std::int64_t, std::filesystem::path> depth_files, pose_files;
  std::size_t others = 0;
  std::error_code error;
  for (auto file = std::filesystem::directory_iterator(options.path, error);
       !error && file != std::filesystem::directory_iterator(); file.increment(error)) {
    const std::string name = file->path().filename().string();
    const bool is_depth = name.ends_with(kDepthSuffix);
    if (!name.starts_with(kPrefix) || !(is_depth || name.ends_with(kPoseSuffix))) {
      ++others;
      continue;
    }
    const auto number = frame_number(name, is_depth ? kDepthSuffix : kPoseSuffix);
    if (!number || static_cast<double>(*number) / options.rate_hz >= kLargest_s) {
      return fail(ErrorCode::kConfig,
                  number ? "the frame's number is no time at rate_hz: stamps end at 285 years"
                         : "the frame has no number",
                  file->path().string());
    }
    const auto [known, is_new] =
        (is_depth ? depth_files : pose_files).emplace(*number, file->path());
    if (is_new) continue;
    return fail(ErrorCode::kConfig,
                "'" + known->second.filename().string() + "' has this number, too",
                file->path().string());
  }
  if (error) {
    return fail(ErrorCode::kIo, "the folder cannot be read: " + error.message(),
                options.path.string());
  }
  if (depth_files.empty() && pose_files.empty()) return std::unique_ptr<Sequence>();
  log.debug("read " + options.path.string() + ": " + std::to_string(depth_files.size()) +
            " depth images and " + std::to_string(pose_files.size()) +
            " poses of layout seven_scenes, " + std::to_string(others) + " other files");
  for (const auto& [number, file] : pose_files) {
    const std::string name = file.filename().string();
    const std::string stem = name.substr(0, name.size() - kPoseSuffix.size());
    depth_files.try_emplace(number, options.path / (stem + std::string(kDepthSuffix)));
  }
  std::vector<SequenceEntry> entries;
  entries.reserve(depth_files.size());
  for (const auto& [number, file] : depth_files) {
    entries.push_back(
        {number, Stamp::from_seconds(static_cast<double>(number) / options.rate_hz), file});
  }
  const std::int64_t span = entries.back().number - entries.front().number + 1;
  if (span != static_cast<std::int64_t>(entries.size())) {
    log.warn(options.path.string() + ": " +
             std::to_string(span - static_cast<std::int64_t>(entries.size())) +
             " frames are missing between number " + std::to_string(entries.front().number) +
             " and " + std::to_string(entries.back().number));
  }
  return std::unique_ptr<Sequence>(std::make_unique<SevenScenes>(std::move(entries)));
}

Result<std::unique_ptr<Sequence>> open_tum(const Options& options, Log& log) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(options.path / "depth.txt", ignored)) {
    return std::unique_ptr<Sequence>();
  }
  auto entries = SIDESTEP_TRY(read_depth_list(options.path));
  if (entries.empty()) return std::unique_ptr<Sequence>();
  const auto pose_file = options.path / "groundtruth.txt";
  auto poses = SIDESTEP_TRY(read_poses(pose_file));
  log.debug("read " + options.path.string() + ": " + std::to_string(entries.size()) +
            " depth images and " + std::to_string(poses.size()) + " poses of layout tum");
  if (const std::size_t count = unlisted(entries); count > 0) {
    log.warn(options.path.string() + ": " + std::to_string(count) +
             " images beside those of depth.txt are not listed there, and not read");
  }
  return std::unique_ptr<Sequence>(std::make_unique<Tum>(
      std::move(entries), std::move(poses), pose_file.string(), options.max_pose_gap_s));
}

Result<std::unique_ptr<Sequence>> open_open3d(const Options& options, Log& log) {
  std::error_code ignored;
  auto pose_file = options.path / "trajectory.log";
  if (!std::filesystem::is_regular_file(pose_file, ignored)) {
    pose_file = options.path / "scene" / "trajectory.log";
  }
  const auto folder = options.path / "depth";
  if (!std::filesystem::is_regular_file(pose_file, ignored) ||
      !std::filesystem::is_directory(folder, ignored)) {
    return std::unique_ptr<Sequence>();
  }
  auto poses = SIDESTEP_TRY(read_trajectory_log(pose_file));
  const auto files = SIDESTEP_TRY(png_files(folder));
  if (files.empty()) return std::unique_ptr<Sequence>();
  log.debug("read " + options.path.string() + ": " + std::to_string(files.size()) +
            " depth images and " + std::to_string(poses.size()) + " poses of layout open3d");
  if (files.size() != poses.size()) {
    log.warn(pose_file.string() + " has " + std::to_string(poses.size()) + " poses for " +
             std::to_string(files.size()) + " images: they are taken in order");
  }
  std::vector<SequenceEntry> entries;
  for (std::size_t i = 0; i < files.size(); ++i) {
    entries.push_back({static_cast<std::int64_t>(i),
                       Stamp::from_seconds(static_cast<double>(i) / options.rate_hz), files[i]});
  }
  return std::unique_ptr<Sequence>(
      std::make_unique<Open3d>(std::move(entries), std::move(poses), pose_file.string()));
}

}  // namespace sidestep::depth_sequence
