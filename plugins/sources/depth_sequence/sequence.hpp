#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/log.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/geometry/transform.hpp>

#include "depth_sequence.hpp"

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

/// The three layouts; null where the folder does not have it.
[[nodiscard]] Result<std::unique_ptr<Sequence>> open_seven_scenes(const Options& options, Log& log);
[[nodiscard]] Result<std::unique_ptr<Sequence>> open_tum(const Options& options, Log& log);
[[nodiscard]] Result<std::unique_ptr<Sequence>> open_open3d(const Options& options, Log& log);

/// How far a written rotation may be from orthonormal, element by element of R^T R - I, before
/// it is refused. Poses of real recordings are off by about 1e-3.
inline constexpr double kRotationTolerance = 1e-2;

/// The rigid transform nearest to a 4x4 matrix. Fails with `code` where an element is not
/// finite, the rotation part is none within kRotationTolerance, or the last row is not 0 0 0 1.
[[nodiscard]] Result<Transform> rigid_transform(const Eigen::Matrix4d& matrix, ErrorCode code,
                                                const std::string& where);

/// A text file of rows x columns numbers separated by blanks. Fails with kNotFound, kIo or
/// `code`, naming the file.
[[nodiscard]] Result<Eigen::MatrixXd> read_matrix(const std::filesystem::path& file, int rows,
                                                  int columns, ErrorCode code);

/// T_world_sequence of a world.yaml. Fails with kConfig at the position of what is wrong.
[[nodiscard]] Result<Transform> read_T_world_sequence(const std::filesystem::path& file,
                                                      const DocumentReader& documents);

}  // namespace sidestep::depth_sequence
