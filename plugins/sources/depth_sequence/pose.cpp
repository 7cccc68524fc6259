#include "pose.hpp"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include <Eigen/SVD>

namespace sidestep::depth_sequence {

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

Result<Eigen::MatrixXd> read_matrix(const std::filesystem::path& file, int rows, int columns,
                                    ErrorCode code) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) {
    return fail(ErrorCode::kNotFound, "there is no such file", file.string());
  }
  std::ifstream stream(file);
  if (!stream) return fail(ErrorCode::kIo, "the file cannot be read", file.string());
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

}  // namespace sidestep::depth_sequence
