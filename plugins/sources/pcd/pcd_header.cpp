#include "pcd_header.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <sstream>

namespace sidestep::pcd {
namespace {

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
    if (key == "VERSION") return {};
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

  Result<void> take_names(const Words& words) {
    if (words.empty()) return bad("FIELDS names no field");
    header_.fields.clear();
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
    if (header_.fields.empty()) return bad("the header has no line FIELDS");
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
};

}  // namespace

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

}  // namespace sidestep::pcd
