#include <sidestep/trajectory/write_trajectory.hpp>

#include <array>
#include <charconv>
#include <cmath>
#include <fstream>

#include <nlohmann/json.hpp>

namespace sidestep {
namespace {

/// The shortest text that is read as the same number.
std::string text_of(double value) {
  std::array<char, 32> text;
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

void write_csv(const Trajectory& trajectory, const std::vector<std::string>& joints,
               std::ostream& out) {
  out << "time_s";
  for (const std::string& joint : joints) out << ',' << joint;
  for (const std::string& joint : joints) out << ',' << joint << ".velocity";
  out << '\n';
  for (int state = 0; state < trajectory.size(); ++state) {
    out << text_of(trajectory.times_s[static_cast<std::size_t>(state)]);
    for (const double value : trajectory.q(state)) out << ',' << text_of(value);
    for (const double value : trajectory.qdot(state)) out << ',' << text_of(value);
    out << '\n';
  }
}

nlohmann::ordered_json message_of(const Trajectory& trajectory,
                                  const std::vector<std::string>& joints) {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  nlohmann::ordered_json points = nlohmann::ordered_json::array();
  for (int state = 0; state < trajectory.size(); ++state) {
    const std::int64_t time_ns =
        std::llround(trajectory.times_s[static_cast<std::size_t>(state)] * kSecond_ns);
    points.push_back(
        {{"positions", trajectory.q(state)},
         {"velocities", trajectory.qdot(state)},
         {"time_from_start", {{"sec", time_ns / kSecond_ns}, {"nanosec", time_ns % kSecond_ns}}}});
  }
  return {{"joint_trajectory", {{"joint_names", joints}, {"points", std::move(points)}}}};
}

}  // namespace

Result<void> write_trajectory(const Trajectory& trajectory, const std::vector<std::string>& joints,
                              const std::filesystem::path& file) {
  SIDESTEP_TRY(trajectory.validate());
  if (joints.size() != static_cast<std::size_t>(trajectory.dof)) {
    return fail(ErrorCode::kInvalidArgument, "the trajectory has " +
                                                 std::to_string(trajectory.dof) + " joints, and " +
                                                 std::to_string(joints.size()) + " are named");
  }
  const std::string kind = file.extension().string();
  const bool is_message = kind == ".json" || kind == ".yaml" || kind == ".yml";
  if (!is_message && kind != ".csv") {
    return fail(ErrorCode::kInvalidArgument, "a trajectory is written as .csv, .json or .yaml",
                file.string());
  }
  for (const std::string& joint : joints) {
    if (joint.find_first_of(",\"\n\r") == std::string::npos || is_message) continue;
    return fail(ErrorCode::kInvalidArgument, "joint '" + joint + "' cannot be a column of CSV",
                file.string());
  }
  std::error_code ignored;
  std::filesystem::create_directories(file.parent_path(), ignored);
  std::ofstream out(file);
  if (is_message) {
    out << message_of(trajectory, joints).dump(1) << '\n';
  } else {
    write_csv(trajectory, joints, out);
  }
  if (out.flush()) return {};
  return fail(ErrorCode::kIo, "cannot be written", file.string());
}

}  // namespace sidestep
