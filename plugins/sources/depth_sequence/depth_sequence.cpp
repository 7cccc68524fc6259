#include "depth_sequence.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "png_depth.hpp"
#include "recorded_frames.hpp"
#include "sequence.hpp"

namespace sidestep::depth_sequence {
namespace {

constexpr ImageSize kVga{640, 480};
constexpr std::uint16_t kRawNothing = 0;
constexpr std::uint16_t kRawInvalid = 65535;

std::string size_text(const ImageSize& size) {
  return std::to_string(size.width_px) + " x " + std::to_string(size.height_px);
}

struct Settings {
  CameraIntrinsics camera;
  Transform T_world_sequence = Transform::Identity();
  double depth_scale = 1000.0;
  double depth_min_m = 0.0;
  double depth_max_m = 0.0;
};

class DepthSequence final : public Source {
 public:
  DepthSequence(std::unique_ptr<Sequence> sequence, std::vector<SequenceEntry> selected,
                Settings settings, Log& log, const std::string& folder)
      : sequence_(std::move(sequence)),
        selected_(std::move(selected)),
        settings_(std::move(settings)),
        tally_(log, folder, selected_.size()) {}

  Result<std::optional<Frame>> next(const Deadline& deadline) override {
    if (deadline.stop_requested()) return fail(ErrorCode::kCancelled, "reading was cancelled");
    if (at_ >= selected_.size()) {
      tally_.tell();
      return std::optional<Frame>();
    }
    if (deadline.expired()) {
      return fail(ErrorCode::kDeadlineExceeded, "no time was left to read a frame");
    }
    const std::size_t index = at_++;
    auto frame = read(selected_[index], static_cast<std::int64_t>(index));
    tally_.count_frame(frame.has_value());
    if (!frame) return error_of(frame);
    return std::optional<Frame>(std::move(*frame));
  }

  std::optional<std::int64_t> frame_count() const override {
    return static_cast<std::int64_t>(selected_.size());
  }

 private:
  [[nodiscard]] Result<Frame> read(const SequenceEntry& entry, std::int64_t index) const {
    const auto bad = [&](const std::string& message, const std::string& file) {
      return fail(ErrorCode::kBadFrame, message,
                  "frame " + std::to_string(entry.number) + " (" + file + ")");
    };
    const auto pose = sequence_->T_sequence_camera(entry);
    if (!pose) return bad(pose.error().message, pose.error().where);
    const auto raw = read_png_depth(entry.depth_file);
    if (!raw) return bad(raw.error().message, raw.error().where);
    const ImageSize expected{settings_.camera.width_px, settings_.camera.height_px};
    if (raw->size != expected) {
      return bad("the image has " + size_text(raw->size) + " pixels, the sequence's have " +
                     size_text(expected),
                 entry.depth_file.string());
    }
    Frame frame;
    frame.sequence = index;
    frame.stamp = entry.stamp;
    frame.T_world_camera = settings_.T_world_sequence * *pose;
    frame.measurement = DepthImage{settings_.camera, to_metres(raw->values)};
    return frame;
  }

  [[nodiscard]] std::vector<float> to_metres(const std::vector<std::uint16_t>& raw) const {
    const double min_m = settings_.depth_min_m;
    const double max_m = settings_.depth_max_m;
    std::vector<float> depth_m(raw.size());
    std::ranges::transform(raw, depth_m.begin(), [&](std::uint16_t value) {
      if (value == kRawNothing) return 0.0F;
      if (value == kRawInvalid) return std::numeric_limits<float>::quiet_NaN();
      const double metres = value / settings_.depth_scale;
      return metres >= min_m && metres <= max_m ? static_cast<float>(metres) : 0.0F;
    });
    return depth_m;
  }

  std::unique_ptr<Sequence> sequence_;
  std::vector<SequenceEntry> selected_;
  Settings settings_;
  recorded_frames::FrameTally tally_;
  std::size_t at_ = 0;
};

/// The size that most of the first readable images have, so that one odd file, even the first,
/// does not decide.
Result<ImageSize> image_size(const std::vector<SequenceEntry>& entries, const Options& options) {
  constexpr int kSurveyed = 5;
  if (options.camera.width_px && options.camera.height_px) {
    return ImageSize{*options.camera.width_px, *options.camera.height_px};
  }
  std::vector<std::pair<ImageSize, int>> votes;
  int readable = 0;
  Error refused;  // why the first that cannot be read cannot
  for (const SequenceEntry& entry : entries) {
    const auto size = read_png_size(entry.depth_file);
    if (!size) {
      if (refused.message.empty()) refused = size.error();
      continue;
    }
    auto vote = std::ranges::find(votes, *size, &std::pair<ImageSize, int>::first);
    if (vote == votes.end()) vote = votes.insert(votes.end(), {*size, 0});
    ++vote->second;
    if (++readable == kSurveyed) break;
  }
  if (votes.empty()) {
    return tl::make_unexpected(refused.wrapped(ErrorCode::kNotFound,
                                               "none of the sequence's depth images can be read",
                                               options.path.string()));
  }
  ImageSize size = std::ranges::max_element(votes, {}, &std::pair<ImageSize, int>::second)->first;
  size.width_px = options.camera.width_px.value_or(size.width_px);
  size.height_px = options.camera.height_px.value_or(size.height_px);
  return size;
}

constexpr const char* kMatrixFile = "camera-intrinsics.txt";  ///< A 3x3 matrix.
constexpr const char* kOpen3dFile = "camera_intrinsic.json";  ///< The same by columns, and sizes.

/// From one of the files, which `file` is then; fails with kNotFound where there is neither.
Result<Eigen::MatrixXd> written_matrix(const Options& options, const ImageSize& size,
                                       const DocumentReader& documents,
                                       std::filesystem::path& file) {
  std::error_code ignored;
  auto matrix = read_matrix(options.path / kMatrixFile, 3, 3, ErrorCode::kConfig);
  const bool is_there = matrix || matrix.error().code != ErrorCode::kNotFound;
  file = options.path / (is_there ? kMatrixFile : kOpen3dFile);
  if (is_there || !std::filesystem::exists(file, ignored)) return matrix;
  const auto document = SIDESTEP_TRY(documents.read(file));
  for (const auto& [key, pixels] :
       {std::pair("width", size.width_px), std::pair("height", size.height_px)}) {
    const Node* node = document.find(key);
    if (node == nullptr) continue;
    const auto value = SIDESTEP_TRY(node->as_double());
    if (value != pixels) {
      return tl::make_unexpected(node->error(
          "these are the intrinsics of other images: theirs have " + size_text(size) + " pixels"));
    }
  }
  const Node* values = document.find("intrinsic_matrix");
  if (values == nullptr) return tl::make_unexpected(document.error("there is no intrinsic_matrix"));
  const auto numbers = SIDESTEP_TRY(values->as_doubles(9));
  return Eigen::MatrixXd(Eigen::Map<const Eigen::Matrix3d>(numbers.data()));
}

/// From the options, else from a file of the sequence, else what the layout's VGA cameras have.
Result<CameraIntrinsics> intrinsics(const Sequence& sequence, const ImageSize& size,
                                    const Options& options, const DocumentReader& documents,
                                    Log& log) {
  CameraIntrinsics camera{size.width_px, size.height_px};
  const CameraOptions& given = options.camera;
  const bool all_given = given.fx_px && given.fy_px && given.cx_px && given.cy_px;
  std::filesystem::path file;
  const auto matrix = written_matrix(options, size, documents, file);
  if (matrix) {
    camera.fx_px = (*matrix)(0, 0);
    camera.fy_px = (*matrix)(1, 1);
    camera.cx_px = (*matrix)(0, 2);
    camera.cy_px = (*matrix)(1, 2);
  } else if (matrix.error().code != ErrorCode::kNotFound) {
    return error_of(matrix);
  } else if (!all_given && size != kVga) {
    return fail(ErrorCode::kConfig,
                "the intrinsics of the images of " + size_text(size) + " pixels are not known",
                options.path.string(), "give camera-intrinsics.txt or source.camera");
  } else if (!all_given) {
    const LayoutDefaults defaults = sequence.defaults();
    camera.fx_px = camera.fy_px = defaults.focal_px;
    camera.cx_px = defaults.cx_px;
    camera.cy_px = defaults.cy_px;
    log.info(options.path.string() + ": no camera-intrinsics.txt, taking those usual for " +
             std::string(sequence.layout()));
  }
  camera.fx_px = given.fx_px.value_or(camera.fx_px);
  camera.fy_px = given.fy_px.value_or(camera.fy_px);
  camera.cx_px = given.cx_px.value_or(camera.cx_px);
  camera.cy_px = given.cy_px.value_or(camera.cy_px);
  const std::string where = matrix ? file.string() : options.path.string();
  if (!(camera.fx_px > 0.0 && camera.fy_px > 0.0 && std::isfinite(camera.fx_px) &&
        std::isfinite(camera.fy_px))) {
    return fail(ErrorCode::kConfig, "the focal lengths must be greater than 0", where);
  }
  if (!(camera.cx_px > 0.0 && camera.cx_px < size.width_px && camera.cy_px > 0.0 &&
        camera.cy_px < size.height_px)) {
    return fail(ErrorCode::kConfig,
                "the principal point lies outside the images of " + size_text(size) + " pixels",
                where, "are these the intrinsics of another camera?");
  }
  return camera;
}

}  // namespace

Result<std::unique_ptr<Source>> create_source(const Options& options, Log& log,
                                              const DocumentReader& documents) {
  auto sequence = SIDESTEP_TRY(open_sequence(options, log));
  auto selected = SIDESTEP_TRY(recorded_frames::chosen_frames(sequence->entries(), options,
                                                              "frames", options.path.string()));
  if (const auto all = sequence->entries().size(); selected.size() < all) {
    log.warn("hands out " + std::to_string(selected.size()) + " of " + std::to_string(all) +
             " frames, as first_frame, stride and max_frames say");
  }
  const auto size = SIDESTEP_TRY(image_size(selected, options));
  const auto camera = SIDESTEP_TRY(intrinsics(*sequence, size, options, documents, log));

  Settings settings;
  settings.camera = camera;
  settings.depth_scale = options.depth_scale.value_or(sequence->defaults().depth_scale);
  settings.depth_min_m = options.depth_min_m;
  settings.depth_max_m = options.depth_max_m;
  const auto world_file = options.path / "world.yaml";
  if (options.use_world && std::filesystem::exists(world_file)) {
    const auto T_world_sequence = SIDESTEP_TRY(read_T_world_sequence(world_file, documents));
    settings.T_world_sequence = T_world_sequence;
  }
  return std::unique_ptr<Source>(std::make_unique<DepthSequence>(
      std::move(sequence), std::move(selected), std::move(settings), log, options.path.string()));
}

}  // namespace sidestep::depth_sequence
