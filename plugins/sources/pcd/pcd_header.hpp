#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep::pcd {

enum class PcdEncoding { kAscii, kBinary, kBinaryCompressed };

struct PcdField {
  std::string name;
  int size_bytes = 4;
  char type = 'F';  ///< I, U or F.
  int count = 1;    ///< Values a point.
};

/// What the header of a PCD file says of its points (format versions 0.5 to 0.7).
struct PcdHeader {
  std::vector<PcdField> fields;
  std::size_t points = 0;
  PcdEncoding encoding = PcdEncoding::kAscii;
  /// VIEWPOINT: where the sensor was. Nothing where the file does not say.
  std::optional<Transform> T_world_sensor;
  std::size_t data_offset = 0;  ///< First byte after the header.
  int data_line = 1;            ///< Its line, from 1.

  [[nodiscard]] std::size_t bytes_per_point() const noexcept;
  [[nodiscard]] std::size_t values_per_point() const noexcept;
};

/// Reads the header of `content`. Fails with kBadFrame at `file`:line.
[[nodiscard]] Result<PcdHeader> read_pcd_header(std::string_view content, const std::string& file);

}  // namespace sidestep::pcd
