#include <algorithm>
#include <charconv>
#include <fstream>
#include <string_view>

#include <sidestep/core/index.hpp>

#include "certify.hpp"

namespace sidestep {
namespace {

constexpr std::string_view kTime = "time_s";
constexpr std::string_view kVelocity = ".velocity";
/// Of waypoints without times.
constexpr double kStep_s = 1.0;

std::vector<std::string> fields_of(const std::string& line) {
  std::vector<std::string> fields{""};
  for (const char c : line) {
    if (c == ',') {
      fields.emplace_back();
    } else if (c != ' ' && c != '\t' && c != '\r') {
      fields.back() += c;
    }
  }
  return fields;
}

class MotionTable {
 public:
  MotionTable(const std::string& file, const RobotDescription& robot)
      : file_(file), robot_(robot) {}

  [[nodiscard]] Result<PolynomialMotion> read() {
    std::ifstream in(file_);
    if (!in) return fail(ErrorCode::kIo, "cannot be read", file_);
    for (std::string text; std::getline(in, text);) {
      ++line_;
      if (text.find_first_not_of(" \t\r") == std::string::npos || text[0] == '#') continue;
      SIDESTEP_TRY(columns_.empty() ? read_header(fields_of(text)) : read_row(fields_of(text)));
    }
    if (rows_ < 2) return wrong("a motion has two lines of numbers at least");
    return motion();
  }

 private:
  struct Column {
    bool is_time = false, is_velocity = false;
    std::size_t joint = 0;
  };

  [[nodiscard]] tl::unexpected<Error> wrong(const std::string& what) const {
    return fail(ErrorCode::kConfig, what, file_ + ":" + std::to_string(line_));
  }

  [[nodiscard]] Result<void> read_header(const std::vector<std::string>& names) {
    const std::size_t dof = robot_.joints.size();
    std::vector<int> positions(dof), velocities(dof);
    for (const std::string& name : names) {
      if (name == kTime) {
        if (has_times_) return wrong("column time_s stands twice");
        has_times_ = true;
        columns_.push_back({.is_time = true});
        continue;
      }
      const bool is_velocity = name.ends_with(kVelocity);
      const auto joint =
          robot_.joint_index(is_velocity ? name.substr(0, name.size() - kVelocity.size()) : name);
      if (!joint) return wrong("robot '" + robot_.name + "' has no joint '" + name + "'");
      if (++(is_velocity ? velocities : positions)[idx(*joint)] > 1) {
        return wrong("column " + name + " stands twice");
      }
      columns_.push_back({.is_velocity = is_velocity, .joint = idx(*joint)});
    }
    has_velocities_ = std::ranges::count(velocities, 1) > 0;
    for (std::size_t j = 0; j < dof; ++j) {
      const std::string& name = robot_.joints[j].name;
      if (positions[j] == 0) return wrong("there is no column for joint '" + name + "'");
      if (has_velocities_ && velocities[j] == 0)
        return wrong("there is no column " + name + ".velocity");
    }
    if (has_velocities_ && !has_times_) return wrong("velocities need a column time_s");
    return {};
  }

  [[nodiscard]] Result<void> read_row(const std::vector<std::string>& fields) {
    if (fields.size() != columns_.size()) {
      return wrong(std::to_string(fields.size()) + " fields where the header has " +
                   std::to_string(columns_.size()));
    }
    const std::size_t dof = robot_.joints.size();
    double time_s = kStep_s * static_cast<double>(rows_);
    positions_.resize(positions_.size() + dof);
    velocities_.resize(positions_.size());
    for (std::size_t i = 0; i < fields.size(); ++i) {
      double number = 0.0;
      const char* const end = fields[i].data() + fields[i].size();
      const auto read = std::from_chars(fields[i].data(), end, number);
      if (read.ec != std::errc() || read.ptr != end || !std::isfinite(number)) {
        return wrong("'" + fields[i] + "' is not a number");
      }
      const Column& column = columns_[i];
      if (column.is_time)
        time_s = number;
      else
        (column.is_velocity ? velocities_ : positions_)[rows_ * dof + column.joint] = number;
    }
    if (rows_ == 0) first_s_ = time_s;
    if (rows_ > 0 && !(time_s - first_s_ > times_s_.back())) {
      return wrong("time does not go on");
    }
    times_s_.push_back(time_s - first_s_);
    ++rows_;
    return {};
  }

  [[nodiscard]] PolynomialMotion motion() const {
    const std::size_t dof = robot_.joints.size();
    PolynomialMotion motion;
    motion.has_times = has_times_;
    for (std::size_t row = 0; row + 1 < rows_; ++row) {
      PolynomialPiece piece{times_s_[row], times_s_[row + 1], {}};
      const double h = piece.end_s - piece.begin_s;
      for (std::size_t j = 0; j < dof; ++j) {
        const double q0 = positions_[row * dof + j];
        const double slope = (positions_[(row + 1) * dof + j] - q0) / h;
        const double v0 = has_velocities_ ? velocities_[row * dof + j] : slope;
        const double v1 = has_velocities_ ? velocities_[(row + 1) * dof + j] : slope;
        piece.coefficients.push_back({q0, v0, (3.0 * slope - 2.0 * v0 - v1) / h,
                                      (v0 + v1 - 2.0 * slope) / (h * h), 0.0, 0.0});
      }
      motion.pieces.push_back(std::move(piece));
    }
    return motion;
  }

  const std::string& file_;
  const RobotDescription& robot_;
  int line_ = 0;
  std::vector<Column> columns_;
  bool has_times_ = false, has_velocities_ = false;
  std::size_t rows_ = 0;
  double first_s_ = 0.0;
  std::vector<double> times_s_, positions_, velocities_;
};

}  // namespace

Result<PolynomialMotion> read_motion(const std::string& file, const RobotDescription& robot) {
  return MotionTable(file, robot).read();
}

}  // namespace sidestep
