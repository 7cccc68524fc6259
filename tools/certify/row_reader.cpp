#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <optional>
#include <sstream>
#include <string_view>

#include <sidestep/core/file.hpp>
#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

#include "motion_reader.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostHeaderBytes = std::size_t{1} << 16;

using Rows = std::vector<std::vector<double>>;

tl::unexpected<Error> wrong(const fs::path& file, const std::string& what) {
  return fail(ErrorCode::kConfig, what, file.string());
}

// By hand: std::regex takes a frame of the stack for each character of a line.

std::string_view without_blanks(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r";
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  return text.substr(0, text.find_last_not_of(kBlanks) + 1);
}

/// What follows a key in a header of NumPy; empty where it is not there.
std::string_view behind(std::string_view header, std::string_view key) {
  const std::size_t at = header.find(key);
  return at == std::string_view::npos ? "" : without_blanks(header.substr(at + key.size()));
}

/// What stands in the brackets of "RealVectorState [1 2]" or "SO2State [1]"; nothing where the line
/// is another one.
std::optional<std::string_view> numbers_of_part(std::string_view line) {
  line = without_blanks(line);
  for (const std::string_view name : {"RealVectorState [", "SO2State ["}) {
    if (!line.starts_with(name) || line.find(']') != line.size() - 1) continue;
    return line.substr(name.size(), line.size() - name.size() - 1);
  }
  return {};
}

/// An array of NumPy: float32 or float64, little-endian, row by row, of two dimensions (or more,
/// of which the first ones are 1).
Result<Rows> read_npy(const fs::path& file, const std::string& bytes) {
  const auto byte = [&](std::size_t at) {
    return std::to_integer<unsigned>(static_cast<std::byte>(bytes[at]));
  };
  if (bytes.size() < 12 || !bytes.starts_with("\x93NUMPY")) {
    return wrong(file, "is no array of NumPy");
  }
  const bool is_first_version = byte(6) == 1;
  const std::size_t begin = is_first_version ? 10 : 12;
  std::size_t length = byte(8) | byte(9) << 8U;
  if (!is_first_version) length |= byte(10) << 16U | byte(11) << 24U;
  if (length > bytes.size() - begin) return wrong(file, "ends within its header");
  if (length > kMostHeaderBytes) return wrong(file, "its header is longer than that of numbers");
  const std::string header = bytes.substr(begin, length);
  const std::string_view descr = behind(header, "'descr':");
  const std::string_view shape = behind(header, "'shape':");
  const std::string listed_sizes(shape.substr(0, shape.find_first_not_of("(0123456789, ")));
  const bool is_known = (descr.starts_with("'<f4'") || descr.starts_with("'<f8'")) &&
                        behind(header, "'fortran_order':").starts_with("False") &&
                        listed_sizes.starts_with('(') &&
                        shape.substr(listed_sizes.size(), 1) == ")";
  if (!is_known) {
    return wrong(
        file,
        "floats of 4 or 8 bytes are wanted, little-endian, row by row (numpy.ascontiguousarray); "
        "it has " +
            header.substr(0, header.find('\n')));
  }
  std::vector<std::size_t> sizes;
  std::stringstream listed(listed_sizes.substr(1));
  for (std::string size; std::getline(listed, size, ',');) {
    if (size.find_first_of("0123456789") == std::string::npos) continue;
    sizes.push_back(std::strtoull(size.c_str(), nullptr, 10));
  }
  while (sizes.size() > 2 && sizes.front() == 1) sizes.erase(sizes.begin());
  const std::size_t width = descr[3] == '4' ? 4 : 8;
  const std::size_t left = bytes.size() - begin - length;
  if (sizes.size() != 2) return wrong(file, "an array of two dimensions is wanted: rows, joints");
  const auto [count, columns] = std::pair(sizes[0], sizes[1]);
  if (columns == 0 || columns > left / width || left % (width * columns) != 0 ||
      left / (width * columns) != count) {
    return wrong(
        file, format("has %zu bytes where its header says %zu rows of %zu", left, count, columns));
  }
  Rows rows(count, std::vector<double>(columns));
  const char* at = bytes.data() + begin + length;
  for (std::vector<double>& row : rows) {
    for (double& number : row) {
      if (width == 4) {
        float single = 0.0F;
        std::memcpy(&single, at, width);
        number = single;
      } else {
        std::memcpy(&number, at, width);
      }
      at += width;
    }
  }
  return rows;
}

/// What OMPL prints: a matrix, a line a state; or "RealVectorState [1 2]" for each state, also
/// within "Compound state [" ... "]" with others of its kind, and "SO2State [1]".
Result<Rows> read_printed(const fs::path& file, const std::string& text) {
  Rows rows;
  std::stringstream lines(text);
  int number = 0;
  const auto wrong_line = [&](const std::string& what) {
    return fail(ErrorCode::kConfig, what, format("%s:%d", file.c_str(), number));
  };
  const auto add_numbers = [&](const std::string& listed, std::vector<double>& row) {
    std::stringstream words(listed);
    for (std::string word; words >> word;) {
      double value = 0.0;
      const char* const end = word.data() + word.size();
      const auto read = std::from_chars(word.data(), end, value);
      if (read.ec != std::errc() || read.ptr != end) return false;
      row.push_back(value);
    }
    return true;
  };
  bool is_compound = false;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const auto first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line.starts_with("Geometric path with")) continue;
    if (line.starts_with("Compound state [")) {
      is_compound = true;
      rows.emplace_back();
    } else if (line[first] == ']' && is_compound) {
      is_compound = false;
    } else {
      if (!is_compound) rows.emplace_back();
      if (!add_numbers(std::string(numbers_of_part(line).value_or(line)), rows.back())) {
        return wrong_line("'" + line + "' is no state of numbers");
      }
    }
    if (!is_compound && rows.back().size() != rows.front().size()) {
      return wrong_line(format("%zu numbers where the first state has %zu", rows.back().size(),
                               rows.front().size()));
    }
  }
  return rows;
}

}  // namespace

Result<std::vector<std::size_t>> joint_order(
    const std::vector<std::string>& names, const RobotDescription& robot,
    const std::function<std::string(std::optional<std::size_t>)>& where) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto joint = robot.joint_index(names[i]);
    if (!joint) {
      return fail(ErrorCode::kConfig, no_such_joint(robot, names[i]), where(i),
                  hint_of_joints(robot));
    }
    if (std::ranges::count(order, idx(*joint)) > 0) {
      return fail(ErrorCode::kConfig, "joint '" + names[i] + "' stands twice", where(i));
    }
    order.push_back(idx(*joint));
  }
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    if (std::ranges::count(order, j) > 0) continue;
    return fail(ErrorCode::kConfig, "joint '" + robot.joints[j].name + "' is not in the motion",
                where({}), hint_to_hold(robot.joints[j].name));
  }
  return order;
}

Result<MotionSamples> read_rows(const fs::path& file, const RobotDescription& robot,
                                const MotionFormat& format) {
  const std::string text = SIDESTEP_TRY(read_file(file));
  const auto rows =
      SIDESTEP_TRY(file.extension() == ".npy" ? read_npy(file, text) : read_printed(file, text));
  if (rows.size() < 2) return wrong(file, "a motion has two rows of numbers at least");
  if (format.joints.empty()) {
    return fail(ErrorCode::kConfig, "its columns have no names: say which joints they are",
                file.string(), "--joints " + listed_joints(robot));
  }
  const auto order =
      SIDESTEP_TRY(joint_order(format.joints, robot, [](auto) { return "--joints"; }));
  MotionSamples samples;
  samples.has_times = format.step_s.has_value();
  for (const std::vector<double>& row : rows) {
    if (row.size() != order.size()) {
      return wrong(file, std::to_string(row.size()) + " columns where --joints names " +
                             std::to_string(order.size()));
    }
    MotionSamples::State state(order.size());
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (!std::isfinite(row[i])) {
        return wrong(file, ::sidestep::format("row %zu, column %zu is not a finite number",
                                              samples.states.size() + 1, i + 1));
      }
      state[order[i]][0] = row[i];
    }
    const auto count = static_cast<double>(samples.states.size());
    if (!samples.add(format.step_s.value_or(1.0) * count, std::move(state))) {
      return wrong(file, "time does not go on");
    }
  }
  return samples;
}

}  // namespace sidestep
