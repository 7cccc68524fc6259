#include <charconv>
#include <map>
#include <optional>

#include "pose.hpp"
#include "sequence.hpp"

namespace sidestep::depth_sequence {
namespace {

constexpr std::string_view kPrefix = "frame-";
constexpr std::string_view kDepthSuffix = ".depth.png";
constexpr std::string_view kPoseSuffix = ".pose.txt";

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

}  // namespace

Result<std::unique_ptr<Sequence>> open_seven_scenes(const Options& options, Log& log) {
  // A frame counts if either of its files is there; what is missing is told frame by frame.
  std::map<std::int64_t, std::filesystem::path> depth_files;
  std::error_code error;
  for (auto file = std::filesystem::directory_iterator(options.path, error);
       !error && file != std::filesystem::directory_iterator(); file.increment(error)) {
    const std::string name = file->path().filename().string();
    if (const auto number = frame_number(name, kDepthSuffix)) {
      depth_files[*number] = file->path();
    } else if (const auto posed = frame_number(name, kPoseSuffix)) {
      const std::string stem = name.substr(0, name.size() - kPoseSuffix.size());
      depth_files.try_emplace(*posed, options.path / (stem + std::string(kDepthSuffix)));
    }
  }
  if (error) {
    return fail(ErrorCode::kIo, "the folder cannot be read: " + error.message(),
                options.path.string());
  }
  if (depth_files.empty()) return std::unique_ptr<Sequence>();
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

}  // namespace sidestep::depth_sequence
