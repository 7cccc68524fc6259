#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep::pcd {

/// Unpacks LZF (M. Lehmann's liblzf), the compression of binary_compressed point clouds, into
/// exactly `size` bytes. Nothing where the data are damaged or unpack to another size.
[[nodiscard]] std::optional<std::vector<std::uint8_t>> unpack_lzf(
    std::span<const std::uint8_t> packed, std::size_t size);

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

/// The points of a PCD file, in the file's frame and order, without those that are not finite.
struct PcdCloud {
  std::vector<Eigen::Vector3f> points_m;
  std::size_t not_finite = 0;               ///< Points of the file that are none of these.
  std::optional<Transform> T_world_sensor;  ///< VIEWPOINT, where the file has one.
};

/// Reads a PCD file of versions 0.5 to 0.7, ascii, binary or binary_compressed. Its fields x, y
/// and z must be floating-point numbers; other fields are skipped. Fails with kBadFrame, naming the
/// file and where it can the line, where the file cannot be read, is cut off, goes on behind its
/// points, is damaged or holds no point.
[[nodiscard]] Result<PcdCloud> read_pcd(const std::filesystem::path& path);

}  // namespace sidestep::pcd
