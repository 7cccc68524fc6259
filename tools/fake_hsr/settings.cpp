#include "settings.hpp"

#include <algorithm>
#include <limits>
#include <sstream>

namespace sidestep::fake_hsr {

const std::vector<std::string>& parts() {
  static const std::vector<std::string> kParts{"camera", "laser", "joint_states",
                                               "odom",   "tf",    "controller"};
  return kParts;
}

Result<Silence> parse_silence(const std::string& text) {
  const auto bad = [&] {
    std::string names;
    for (const std::string& part : parts()) names += (names.empty() ? "" : ", ") + part;
    return fail(ErrorCode::kInvalidArgument,
                "'" + text + "' is not PART@FROM or PART@FROM+FOR in seconds", "--silence",
                "parts: " + names);
  };
  const std::size_t at = text.find('@');
  if (at == std::string::npos) return bad();
  Silence silence{text.substr(0, at), 0.0, std::numeric_limits<double>::infinity()};
  if (std::ranges::find(parts(), silence.part) == parts().end()) return bad();
  std::istringstream numbers(text.substr(at + 1));
  if (!(numbers >> silence.from_s)) return bad();
  if (numbers.peek() == '+') {
    numbers.get();
    double length_s = 0.0;
    if (!(numbers >> length_s)) return bad();
    silence.until_s = silence.from_s + length_s;
  }
  if (numbers.peek() != std::istringstream::traits_type::eof()) return bad();
  return silence;
}

bool is_silent(const std::vector<Silence>& silences, const std::string& part,
               std::optional<double> since_command_s) {
  if (!since_command_s) return false;
  return std::ranges::any_of(silences, [&](const Silence& silence) {
    return silence.part == part && *since_command_s >= silence.from_s &&
           *since_command_s < silence.until_s;
  });
}

}  // namespace sidestep::fake_hsr
