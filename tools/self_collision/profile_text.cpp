#include "profile_text.hpp"

#include <sstream>

namespace sidestep {

std::string self_collision_block(const RobotDescription& robot,
                                 const std::vector<PairStatistics>& pairs,
                                 const SamplingOptions& options) {
  const auto name = [&](int link) { return robot.links[static_cast<std::size_t>(link)].name; };
  std::string text =
      "self_collision:\n  # Found by sidestep_self_collision: " + std::to_string(options.samples) +
      " samples, seed " + std::to_string(options.seed) +
      ".\n  # Neighbours and pairs that always or never touch are left out.\n";
  std::string lines;
  for (const PairStatistics& pair : pairs) {
    if (pair.verdict != PairStatistics::Verdict::kChecked) continue;
    lines += "    - [" + name(pair.a) + ", " + name(pair.b) + "]\n";
  }
  return text + (lines.empty() ? "  pairs: []\n" : "  pairs:\n" + lines);
}

std::string with_self_collision(const std::string& profile, const std::string& block) {
  std::istringstream lines(profile);
  std::string out;
  std::string line;
  bool inside = false;
  bool placed = false;
  while (std::getline(lines, line)) {
    const bool starts_key = !line.empty() && line[0] != ' ' && line[0] != '#' && line[0] != '-';
    if (line.starts_with("self_collision:")) {
      inside = true;
      if (!placed) out += block;
      placed = true;
    } else if (!inside || starts_key || line.starts_with('#')) {
      inside = false;
      out += line + "\n";
    }
  }
  if (!placed) out += "\n" + block;
  return out;
}

}  // namespace sidestep
