#pragma once

#include <filesystem>
#include <string>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep::depth_sequence {

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
