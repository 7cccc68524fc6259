#include "pcd_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <set>
#include <sstream>

#include <sidestep/core/file.hpp>

namespace sidestep::pcd {
namespace {

constexpr std::size_t kLongestCopy = 264;
constexpr std::size_t kMostBytesPerPoint = std::size_t{1} << 26;

using Words = std::vector<std::string>;

template <class Number>
std::optional<Number> parse(const std::string& word) {
  Number value{};
  const char* end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, value);
  if (error != std::errc{} || stop != end) return std::nullopt;
  return value;
}

Words split(std::string_view line) {
  std::istringstream stream{std::string(line)};
  Words words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

/// Reads a header line by line; the order of the lines is that of the format.
class HeaderReader {
 public:
  HeaderReader(std::string_view content, const std::string& file)
      : content_(content), file_(file) {}

  Result<PcdHeader> read() {
    while (at_ < content_.size()) {
      const std::size_t end = std::min(content_.find('\n', at_), content_.size());
      Words words = split(content_.substr(at_, end - at_));
      ++line_;
      at_ = end + 1;
      if (words.empty() || words[0].starts_with('#')) continue;
      const std::string key = words[0];
      words.erase(words.begin());
      SIDESTEP_TRY(take(key, words));
      if (key == "DATA") return finish();
    }
    return bad("the header has no line DATA; the file is cut off, or no point cloud");
  }

 private:
  [[nodiscard]] tl::unexpected<Error> bad(const std::string& message) const {
    return fail(ErrorCode::kBadFrame, message, file_ + ":" + std::to_string(std::max(line_, 1)));
  }

  Result<void> take(const std::string& key, const Words& words) {
    if (!lines_.insert(key == "COLUMNS" ? "FIELDS" : key).second) {
      return bad("there is a second line " + key);
    }
    if (key == "VERSION") return take_version(words);
    if (key == "FIELDS" || key == "COLUMNS") return take_names(words);
    if (key == "SIZE") return take_numbers(key, words, 1, 8, &PcdField::size_bytes);
    if (key == "COUNT") return take_numbers(key, words, 0, 1 << 20, &PcdField::count);
    if (key == "TYPE") return take_types(words);
    if (key == "VIEWPOINT") return take_viewpoint(words);
    if (key == "WIDTH") return take_size(key, words, width_);
    if (key == "HEIGHT") return take_size(key, words, height_);
    if (key == "POINTS") return take_size(key, words, points_);
    if (key == "DATA") return take_encoding(words);
    return bad("'" + key.substr(0, 40) + "' is no line of a PCD header");
  }

  Result<void> take_version(const Words& words) {
    constexpr std::array kRead = {".5", "0.5", ".6", "0.6", ".7", "0.7"};
    if (words.size() == 1 && std::ranges::find(kRead, words[0]) != kRead.end()) return {};
    return bad("VERSION is none of 0.5, 0.6 and 0.7");
  }

  Result<void> take_names(const Words& words) {
    if (words.empty()) return bad("FIELDS names no field");
    for (const std::string& name : words) header_.fields.push_back({.name = name});
    return {};
  }

  Result<void> check_width(const std::string& key, const Words& words) const {
    if (words.size() == header_.fields.size()) return {};
    return bad(key + " has " + std::to_string(words.size()) + " values, FIELDS has " +
               std::to_string(header_.fields.size()));
  }

  Result<void> take_numbers(const std::string& key, const Words& words, int min, int max,
                            int PcdField::*member) {
    SIDESTEP_TRY(check_width(key, words));
    for (std::size_t i = 0; i < words.size(); ++i) {
      const auto value = parse<int>(words[i]);
      if (!value || *value < min || *value > max) {
        return bad(key + " of the field " + header_.fields[i].name + " is '" + words[i] + "'");
      }
      header_.fields[i].*member = *value;
    }
    return {};
  }

  Result<void> take_types(const Words& words) {
    SIDESTEP_TRY(check_width("TYPE", words));
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (words[i] != "I" && words[i] != "U" && words[i] != "F") {
        return bad("TYPE of the field " + header_.fields[i].name + " is '" + words[i] +
                   "', expected I, U or F");
      }
      header_.fields[i].type = words[i][0];
    }
    return {};
  }

  Result<void> take_viewpoint(const Words& words) {
    std::array<double, 7> values{};
    bool right = words.size() == values.size();
    for (std::size_t i = 0; right && i < values.size(); ++i) {
      const auto value = parse<double>(words[i]);
      right = value && std::isfinite(*value);
      if (right) values[i] = *value;
    }
    if (!right) return bad("VIEWPOINT is not seven finite numbers, tx ty tz qw qx qy qz");
    const Eigen::Quaterniond rotation(values[3], values[4], values[5], values[6]);
    if (std::abs(rotation.norm() - 1.0) > 1e-2) {
      return bad("the quaternion of VIEWPOINT, qw qx qy qz, has the length " +
                 std::to_string(rotation.norm()) + ", expected 1");
    }
    Transform T_world_sensor = Transform::Identity();
    T_world_sensor.translation() = Eigen::Vector3d(values[0], values[1], values[2]);
    T_world_sensor.linear() = rotation.normalized().toRotationMatrix();
    header_.T_world_sensor = T_world_sensor;
    return {};
  }

  Result<void> take_size(const std::string& key, const Words& words,
                         std::optional<std::size_t>& into) const {
    const auto value = words.size() == 1 ? parse<std::uint32_t>(words[0]) : std::nullopt;
    if (!value) return bad(key + " is not one whole number");
    into = *value;
    return {};
  }

  Result<void> take_encoding(const Words& words) {
    const std::string name = words.size() == 1 ? words[0] : "";
    if (name == "ascii") {
      header_.encoding = PcdEncoding::kAscii;
    } else if (name == "binary") {
      header_.encoding = PcdEncoding::kBinary;
    } else if (name == "binary_compressed") {
      header_.encoding = PcdEncoding::kBinaryCompressed;
    } else {
      return bad("DATA is '" + name + "', expected ascii, binary or binary_compressed");
    }
    return {};
  }

  Result<PcdHeader> finish() {
    for (const char* line : {"FIELDS", "SIZE", "TYPE"}) {
      if (!lines_.contains(line)) return bad(std::string("the header has no line ") + line);
    }
    if (!points_ && !(width_ && height_)) {
      return bad("the header does not say how many points there are (POINTS, or WIDTH and HEIGHT)");
    }
    if (points_ && width_ && height_ && *points_ != *width_ * *height_) {
      return bad("POINTS is " + std::to_string(*points_) + ", WIDTH times HEIGHT is " +
                 std::to_string(*width_ * *height_));
    }
    header_.points = points_ ? *points_ : *width_ * *height_;
    if (header_.points > std::numeric_limits<std::uint32_t>::max()) {
      return bad("the header names " + std::to_string(header_.points) + " points");
    }
    // So that the bytes of all points can be counted in 64 bits.
    if (header_.bytes_per_point() > kMostBytesPerPoint) {
      return bad("the header names points of " + std::to_string(header_.bytes_per_point()) +
                 " bytes");
    }
    header_.data_offset = std::min(at_, content_.size());
    header_.data_line = line_ + 1;
    return header_;
  }

  std::string_view content_;
  const std::string& file_;
  std::size_t at_ = 0;
  int line_ = 0;
  PcdHeader header_;
  std::optional<std::size_t> width_, height_, points_;
  std::set<std::string> lines_;  ///< Those that there were.
};

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
    if (std::ranges::count(header.fields, name, &PcdField::name) > 1) {
      return fail(ErrorCode::kBadFrame, "there are several fields " + name, file);
    }
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
        auto [number_end, error] = std::from_chars(word, word_end, number);
        // Beyond the largest number, or next to 0.
        if (error == std::errc::result_out_of_range) {
          number = std::strtod(std::string(word, word_end).c_str(), nullptr);
        }
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

tl::unexpected<Error> goes_on(std::size_t has, std::size_t needs, const std::string& file) {
  return fail(ErrorCode::kBadFrame,
              "the file goes on behind its points, by " + std::to_string(has - needs) + " bytes",
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
  if (data.size() > header.points * stride) {
    return goes_on(data.size(), header.points * stride, file);
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
  if (packed.size() > sizes[0]) return goes_on(packed.size(), sizes[0], file);
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

std::optional<std::vector<std::uint8_t>> unpack_lzf(std::span<const std::uint8_t> packed,
                                                    std::size_t size) {
  // Before anything is allocated for a size that a damaged file made up.
  if (size / kLongestCopy > packed.size()) return std::nullopt;
  std::vector<std::uint8_t> out;
  out.reserve(size);
  std::size_t at = 0;
  while (at < packed.size()) {
    const std::size_t control = packed[at++];
    if (control < 32) {  // control + 1 bytes as they are
      const std::size_t length = control + 1;
      if (length > packed.size() - at || length > size - out.size()) return std::nullopt;
      for (std::size_t i = 0; i < length; ++i) out.push_back(packed[at++]);
      continue;
    }
    // A copy of what came `distance` bytes before; it may overlap itself.
    std::size_t length = control >> 5;
    if (length == 7) {
      if (at == packed.size()) return std::nullopt;
      length += packed[at++];
    }
    length += 2;
    if (at == packed.size()) return std::nullopt;
    const std::size_t distance = ((control & 31) << 8 | packed[at++]) + 1;
    if (distance > out.size() || length > size - out.size()) return std::nullopt;
    for (std::size_t i = 0; i < length; ++i) out.push_back(out[out.size() - distance]);
  }
  if (out.size() != size) return std::nullopt;
  return out;
}

std::size_t PcdHeader::bytes_per_point() const noexcept {
  std::size_t bytes = 0;
  for (const PcdField& field : fields) {
    bytes += static_cast<std::size_t>(field.size_bytes) * static_cast<std::size_t>(field.count);
  }
  return bytes;
}

std::size_t PcdHeader::values_per_point() const noexcept {
  std::size_t values = 0;
  for (const PcdField& field : fields) values += static_cast<std::size_t>(field.count);
  return values;
}

Result<PcdHeader> read_pcd_header(std::string_view content, const std::string& file) {
  return HeaderReader(content, file).read();
}

constexpr std::uintmax_t kMostCloudBytes = std::uintmax_t{1} << 30;

Result<PcdCloud> read_pcd(const std::filesystem::path& path) {
  const std::string file = path.string();
  const auto read = read_file(path, kMostCloudBytes);
  if (!read) return fail(ErrorCode::kBadFrame, read.error().message, file);
  const std::string& content = *read;
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
  const std::size_t not_finite = header.points - points.size();
  return PcdCloud{std::move(points), not_finite, header.T_world_sensor};
}

}  // namespace sidestep::pcd
