#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/log.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/geometry/transform.hpp>

#include "options.hpp"

namespace sidestep::depth_sequence {

/// One frame that a sequence's files name, whether or not they can be read.
struct SequenceEntry {
  std::int64_t number = 0;  ///< As the files count.
  Stamp stamp;
  std::filesystem::path depth_file;
};

/// What the layout says where the sequence itself says nothing.
struct LayoutDefaults {
  double depth_scale = 0.0;  ///< Raw units in a metre.
  double focal_px = 0.0;     ///< Of a VGA image.
  double cx_px = 0.0;
  double cy_px = 0.0;
};

/// A recording in one of the layouts that are understood.
class Sequence {
 public:
  virtual ~Sequence() = default;
  [[nodiscard]] virtual std::string_view layout() const = 0;
  [[nodiscard]] virtual LayoutDefaults defaults() const = 0;
  /// In the order of their stamps; at least one.
  [[nodiscard]] virtual const std::vector<SequenceEntry>& entries() const = 0;
  /// The camera's pose in the sequence's own frame. Fails with kBadFrame.
  [[nodiscard]] virtual Result<Transform> T_sequence_camera(const SequenceEntry& entry) const = 0;
};

/// Opens the folder that the options name. Fails with kNotFound where there is none, or none
/// of the layouts in it.
[[nodiscard]] Result<std::unique_ptr<Sequence>> open_sequence(const Options& options, Log& log);

/// The two layouts; null where the folder does not have it.
[[nodiscard]] Result<std::unique_ptr<Sequence>> open_seven_scenes(const Options& options, Log& log);
[[nodiscard]] Result<std::unique_ptr<Sequence>> open_tum(const Options& options, Log& log);

}  // namespace sidestep::depth_sequence
