#include "pcd_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstring>
#include <fstream>
#include <span>
#include <sstream>
#include <string>
#include <string_view>

#include "lzf.hpp"
#include "pcd_header.hpp"

namespace sidestep::pcd {
namespace {

static_assert(std::endian::native == std::endian::little, "PCD files are little endian");

/// Where x, y and z are within a point.
struct Coordinate {
  std::size_t field = 0;  ///< Index of the field.
  std::size_t value = 0;  ///< Values before it in a point.
  std::size_t byte = 0;   ///< Bytes before it in a point.
  int size_bytes = 4;
};
using Coordinates = std::array<Coordinate, 3>;

Result<Coordinates> find_coordinates(const PcdHeader& header, const std::string& file) {
  Coordinates coordinates;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string name(1, "xyz"[axis]);
    Coordinate at;
    while (at.field < header.fields.size() && header.fields[at.field].name != name) {
      const PcdField& before = header.fields[at.field++];
      at.value += static_cast<std::size_t>(before.count);
      at.byte +=
          static_cast<std::size_t>(before.count) * static_cast<std::size_t>(before.size_bytes);
    }
    if (at.field == header.fields.size()) {
      std::string names;
      for (const PcdField& field : header.fields) names += " " + field.name;
      return fail(ErrorCode::kBadFrame, "there is no field " + name + " among the fields" + names,
                  file);
    }
    const PcdField& field = header.fields[at.field];
    if (field.type != 'F' || (field.size_bytes != 4 && field.size_bytes != 8) || field.count != 1) {
      return fail(ErrorCode::kBadFrame,
                  "the field " + name + " is of type " + field.type + ", size " +
                      std::to_string(field.size_bytes) + " and count " +
                      std::to_string(field.count) + ", expected F, 4 or 8, and 1",
                  file);
    }
    at.size_bytes = field.size_bytes;
    coordinates[axis] = at;
  }
  return coordinates;
}

float load(const std::uint8_t* bytes, int size_bytes) {
  if (size_bytes == 8) {
    double value;
    std::memcpy(&value, bytes, sizeof value);
    return static_cast<float>(value);
  }
  float value;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

void keep_finite(const Eigen::Vector3f& point, std::vector<Eigen::Vector3f>& points) {
  if (point.allFinite()) points.push_back(point);
}

Result<std::vector<Eigen::Vector3f>> read_ascii(std::string_view content, const PcdHeader& header,
                                                const Coordinates& coordinates,
                                                const std::string& file) {
  std::vector<Eigen::Vector3f> points;
  const std::size_t expected = header.values_per_point();
  std::size_t read = 0;
  int line = header.data_line - 1;
  for (std::size_t at = header.data_offset; at < content.size();) {
    const std::size_t end = std::min(content.find('\n', at), content.size());
    ++line;
    const auto bad = [&](const std::string& message) {
      return fail(ErrorCode::kBadFrame, message, file + ":" + std::to_string(line));
    };
    Eigen::Vector3f point;
    std::size_t value = 0;
    const char* word = content.data() + at;
    const char* const stop = content.data() + end;
    const auto skip_blanks = [&] {
      while (word < stop && (*word == ' ' || *word == '\t' || *word == '\r')) ++word;
    };
    for (skip_blanks(); word < stop; skip_blanks(), ++value) {
      const char* word_end =
          std::find_if(word, stop, [](char c) { return c == ' ' || c == '\t' || c == '\r'; });
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (coordinates[axis].value != value) continue;
        double number = 0.0;
        const auto [number_end, error] = std::from_chars(word, word_end, number);
        if (error == std::errc::invalid_argument || number_end != word_end) {
          return bad("expected a number, found '" + std::string(word, word_end) + "'");
        }
        point[static_cast<int>(axis)] = static_cast<float>(number);
      }
      word = word_end;
    }
    at = end + 1;
    if (value == 0) continue;
    if (value != expected) {
      return bad("expected " + std::to_string(expected) + " values a point, found " +
                 std::to_string(value));
    }
    if (++read > header.points) {
      return bad("there are more points than the " + std::to_string(header.points) +
                 " that the header names");
    }
    keep_finite(point, points);
  }
  if (read < header.points) {
    return fail(ErrorCode::kBadFrame,
                "the file is cut off: it holds " + std::to_string(read) + " of " +
                    std::to_string(header.points) + " points",
                file);
  }
  return points;
}

/// `stride` of each axis leads from a point's value to the next point's.
std::vector<Eigen::Vector3f> gather(std::span<const std::uint8_t> bytes, std::size_t count,
                                    const Coordinates& coordinates,
                                    const std::array<std::size_t, 3>& first,
                                    const std::array<std::size_t, 3>& stride) {
  std::vector<Eigen::Vector3f> points;
  points.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    Eigen::Vector3f point;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      point[static_cast<int>(axis)] =
          load(&bytes[first[axis] + i * stride[axis]], coordinates[axis].size_bytes);
    }
    keep_finite(point, points);
  }
  return points;
}

tl::unexpected<Error> cut_off(std::size_t has, std::size_t needs, const std::string& file) {
  return fail(ErrorCode::kBadFrame,
              "the file is cut off: it holds " + std::to_string(has) + " of " +
                  std::to_string(needs) + " bytes of points",
              file);
}

Result<std::vector<Eigen::Vector3f>> read_binary(std::span<const std::uint8_t> data,
                                                 const PcdHeader& header,
                                                 const Coordinates& coordinates,
                                                 const std::string& file) {
  const std::size_t stride = header.bytes_per_point();
  if (data.size() < header.points * stride) {
    return cut_off(data.size(), header.points * stride, file);
  }
  return gather(data, header.points, coordinates,
                {coordinates[0].byte, coordinates[1].byte, coordinates[2].byte},
                {stride, stride, stride});
}

/// Two sizes, packed and unpacked; then all values of the first field, all of the second, ...
Result<std::vector<Eigen::Vector3f>> read_compressed(std::span<const std::uint8_t> data,
                                                     const PcdHeader& header,
                                                     const Coordinates& coordinates,
                                                     const std::string& file) {
  std::array<std::uint32_t, 2> sizes;
  if (data.size() < sizeof sizes) return cut_off(data.size(), sizeof sizes, file);
  std::memcpy(sizes.data(), data.data(), sizeof sizes);
  const auto packed = data.subspan(sizeof sizes);
  if (packed.size() < sizes[0]) return cut_off(packed.size(), sizes[0], file);
  const std::size_t needed = header.points * header.bytes_per_point();
  if (sizes[1] != needed) {
    return fail(ErrorCode::kBadFrame,
                "the compressed points unpack to " + std::to_string(sizes[1]) +
                    " bytes, the header names points of " + std::to_string(needed),
                file);
  }
  const auto bytes = unpack_lzf(packed.first(sizes[0]), needed);
  if (!bytes) return fail(ErrorCode::kBadFrame, "the compressed points are damaged", file);
  std::array<std::size_t, 3> first{}, stride{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    first[axis] = coordinates[axis].byte * header.points;
    stride[axis] = static_cast<std::size_t>(coordinates[axis].size_bytes);
  }
  return gather(*bytes, header.points, coordinates, first, stride);
}

}  // namespace

Result<PcdCloud> read_pcd(const std::filesystem::path& path) {
  const std::string file = path.string();
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return fail(ErrorCode::kBadFrame, "the file cannot be read", file);
  std::ostringstream buffer;
  buffer << stream.rdbuf();
  const std::string content = std::move(buffer).str();
  if (content.empty()) return fail(ErrorCode::kBadFrame, "the file is empty", file);

  const auto header = SIDESTEP_TRY(read_pcd_header(content, file));
  const auto coordinates = SIDESTEP_TRY(find_coordinates(header, file));
  const std::span data(reinterpret_cast<const std::uint8_t*>(content.data()) + header.data_offset,
                       content.size() - header.data_offset);
  auto points = SIDESTEP_TRY(
      header.encoding == PcdEncoding::kAscii    ? read_ascii(content, header, coordinates, file)
      : header.encoding == PcdEncoding::kBinary ? read_binary(data, header, coordinates, file)
                                                : read_compressed(data, header, coordinates, file));
  if (points.empty()) {
    return fail(ErrorCode::kBadFrame,
                header.points == 0
                    ? "the file holds no points"
                    : "none of the file's " + std::to_string(header.points) + " points is finite",
                file);
  }
  return PcdCloud{std::move(points), header.T_world_sensor};
}

}  // namespace sidestep::pcd
