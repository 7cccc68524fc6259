#include "motion_reader.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <string_view>

#include <sidestep/core/file.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/runtime/yaml_document.hpp>

namespace sidestep {
namespace {

constexpr std::string_view kTime = "time_s";
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

class CsvMotion {
 public:
  CsvMotion(const std::filesystem::path& file, const RobotDescription& robot,
            std::optional<double> step_s)
      : file_(file), robot_(robot), step_s_(step_s) {}

  [[nodiscard]] Result<MotionSamples> read() {
    std::istringstream in(SIDESTEP_TRY(read_file(file_)));
    for (std::string text; std::getline(in, text);) {
      if (++line_ == 1 && text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);  // a mark of UTF-8
      if (text.find_first_not_of(" \t\r") == std::string::npos || text[0] == '#') continue;
      SIDESTEP_TRY(columns_.empty() ? read_header(fields_of(text)) : read_row(fields_of(text)));
    }
    if (samples_.times_s.size() < 2) {
      return fail(ErrorCode::kConfig, "a motion has two lines of numbers at least", file_.string());
    }
    return std::move(samples_);
  }

 private:
  enum Kind { kPosition, kVelocity, kAcceleration };
  static constexpr std::array<std::string_view, 3> kSuffixes{"", ".velocity", ".acceleration"};
  struct Column {
    bool is_time = false;
    Kind kind = kPosition;
    std::size_t joint = 0;
  };

  [[nodiscard]] tl::unexpected<Error> wrong(const std::string& what,
                                            const std::string& hint = "") const {
    return fail(ErrorCode::kConfig, what, file_.string() + ":" + std::to_string(line_), hint);
  }

  [[nodiscard]] Result<void> read_header(const std::vector<std::string>& names) {
    const std::size_t dof = robot_.joints.size();
    std::array<std::vector<int>, 3> found;
    for (auto& of : found) of.resize(dof);
    samples_.has_times = false;
    for (const std::string& name : names) {
      if (name == kTime) {
        if (samples_.has_times) return wrong("column time_s stands twice");
        samples_.has_times = true;
        columns_.push_back({.is_time = true});
        continue;
      }
      const Kind kind = name.ends_with(kSuffixes[kVelocity])       ? kVelocity
                        : name.ends_with(kSuffixes[kAcceleration]) ? kAcceleration
                                                                   : kPosition;
      const auto joint = robot_.joint_index(name.substr(0, name.size() - kSuffixes[kind].size()));
      if (!joint) return wrong(no_such_joint(robot_, name), hint_of_joints(robot_));
      if (++found[kind][idx(*joint)] > 1) return wrong("column " + name + " stands twice");
      columns_.push_back({.kind = kind, .joint = idx(*joint)});
    }
    if (samples_.has_times && step_s_) return wrong("has times, and --step_s says others");
    samples_.has_times = samples_.has_times || step_s_;
    samples_.has_velocities = std::ranges::count(found[kVelocity], 1) > 0;
    samples_.has_accelerations = std::ranges::count(found[kAcceleration], 1) > 0;
    const std::array wanted{true, samples_.has_velocities, samples_.has_accelerations};
    for (std::size_t j = 0; j < dof; ++j) {
      for (const Kind kind : {kPosition, kVelocity, kAcceleration}) {
        if (!wanted[kind] || found[kind][j] > 0) continue;
        return wrong("there is no column " + robot_.joints[j].name + std::string(kSuffixes[kind]),
                     kind == kPosition ? hint_to_hold(robot_.joints[j].name) : "");
      }
    }
    if (samples_.has_velocities && !samples_.has_times) {
      return wrong("velocities need a column time_s");
    }
    return {};
  }

  [[nodiscard]] Result<void> read_row(const std::vector<std::string>& fields) {
    if (fields.size() != columns_.size()) {
      return wrong(std::to_string(fields.size()) + " fields where the header has " +
                   std::to_string(columns_.size()));
    }
    double time_s = step_s_.value_or(kStep_s) * static_cast<double>(samples_.times_s.size());
    MotionSamples::State state(robot_.joints.size());
    for (std::size_t i = 0; i < fields.size(); ++i) {
      double number = 0.0;
      const char* const end = fields[i].data() + fields[i].size();
      const auto read = std::from_chars(fields[i].data(), end, number);
      if (read.ec != std::errc() || read.ptr != end || !std::isfinite(number)) {
        return wrong("field " + std::to_string(i + 1) + ", '" + fields[i] + "', is not a number");
      }
      const Column& column = columns_[i];
      (column.is_time ? time_s : state[column.joint][column.kind]) = number;
    }
    if (!samples_.add(time_s, std::move(state))) return wrong("time does not go on");
    return {};
  }

  const std::filesystem::path& file_;
  const RobotDescription& robot_;
  std::optional<double> step_s_;
  int line_ = 0;
  std::vector<Column> columns_;
  MotionSamples samples_;
};

/// The coefficients from one state of a joint to the next, h seconds later.
std::array<double, PolynomialPiece::kTerms> between(const std::array<double, 3>& from,
                                                    const std::array<double, 3>& to, double h,
                                                    Joining joining) {
  const auto [q0, v0, a0] = from;
  const auto [q1, v1, a1] = to;
  const double way = q1 - q0;
  switch (joining) {
    case Joining::kLinear: return {q0, way / h};
    case Joining::kCubic: return cubic(q0, v0, q1, v1, h);
    case Joining::kQuintic: break;
  }
  const double h2 = h * h;
  return {
      q0,
      v0,
      0.5 * a0,
      (20.0 * way - (8.0 * v1 + 12.0 * v0) * h - (3.0 * a0 - a1) * h2) / (2.0 * h2 * h),
      (-30.0 * way + (14.0 * v1 + 16.0 * v0) * h + (3.0 * a0 - 2.0 * a1) * h2) / (2.0 * h2 * h2),
      (12.0 * way - 6.0 * (v1 + v0) * h - (a0 - a1) * h2) / (2.0 * h2 * h2 * h)};
}

}  // namespace

bool MotionSamples::add(double time_s, State state) {
  if (times_s.empty()) first_s = time_s;
  if (!times_s.empty() && !(time_s - first_s > times_s.back())) return false;
  times_s.push_back(time_s - first_s);
  states.push_back(std::move(state));
  return true;
}

namespace {

Result<PolynomialMotion> joined(const MotionSamples& samples, std::optional<Joining> joining,
                                const std::string& where) {
  PolynomialMotion motion;
  motion.has_times = samples.has_times;
  motion.joining = joining.value_or(!samples.has_velocities     ? Joining::kLinear
                                    : samples.has_accelerations ? Joining::kQuintic
                                                                : Joining::kCubic);
  const bool lacks = (motion.joining != Joining::kLinear && !samples.has_velocities) ||
                     (motion.joining == Joining::kQuintic && !samples.has_accelerations);
  if (lacks) {
    return fail(ErrorCode::kConfig, "has no velocities, or accelerations, to be joined by", where);
  }
  for (std::size_t k = 0; k + 1 < samples.times_s.size(); ++k) {
    PolynomialPiece piece{samples.times_s[k], samples.times_s[k + 1], {}};
    for (std::size_t j = 0; j < samples.states[k].size(); ++j) {
      piece.coefficients.push_back(between(samples.states[k][j], samples.states[k + 1][j],
                                           piece.end_s - piece.begin_s, motion.joining));
    }
    motion.pieces.push_back(std::move(piece));
  }
  return motion;
}

Result<std::vector<NamedSamples>> read_samples(const std::filesystem::path& file,
                                               const RobotDescription& robot,
                                               const MotionFormat& format) {
  const std::string kind = file.extension().string();
  if (kind == ".bag") return read_recorded_motions(file, robot);
  if (kind == ".db") {
    return fail(ErrorCode::kConfig, "the database of a benchmark of OMPL holds no paths",
                file.string(), "have each run print its path, with printAsMatrix(), into a .txt");
  }
  const bool is_message = kind == ".yaml" || kind == ".yml" || kind == ".json";
  if (!is_message && kind != ".csv" && kind != ".npy" && kind != ".txt") {
    return fail(ErrorCode::kConfig, "a motion is .csv, .npy, .txt, .bag, or a message in .yaml",
                file.string());
  }
  auto samples = kind == ".csv" ? CsvMotion(file, robot, format.step_s).read()
                 : is_message   ? read_moveit_motion(file, robot)
                                : read_rows(file, robot, format);
  if (!samples) return tl::make_unexpected(std::move(samples.error()));
  return std::vector{NamedSamples{file.string(), std::move(*samples)}};
}

}  // namespace

Result<std::vector<NamedMotion>> read_motions(const std::filesystem::path& file,
                                              const RobotDescription& robot,
                                              const MotionFormat& format) {
  std::vector<NamedMotion> motions;
  for (const auto& [name, samples] : SIDESTEP_TRY(read_samples(file, robot, format))) {
    motions.push_back({name, SIDESTEP_TRY(joined(samples, format.joining, name))});
  }
  return motions;
}

}  // namespace sidestep
