// Finds the pairs of a robot's links that must be checked for self-collision, by sampling, and
// writes them into its profile.

#include <CLI/CLI.hpp>
#include <cstdio>

#include <sidestep/core/file.hpp>

#include "number_range.hpp"
#include "pair_statistics.hpp"
#include "profile_robot.hpp"

namespace {

using namespace sidestep;

struct Arguments {
  std::string profile;
  SamplingOptions sampling;
  bool write = false;
};

const char* verdict_name(PairStatistics::Verdict verdict) {
  switch (verdict) {
    case PairStatistics::Verdict::kChecked: return "checked";
    case PairStatistics::Verdict::kAdjacent: return "adjacent";
    case PairStatistics::Verdict::kAlways: return "always";
    case PairStatistics::Verdict::kNever: return "never";
  }
  return "";
}

void print_table(const RobotDescription& robot, const std::vector<PairStatistics>& pairs,
                 int samples) {
  std::fprintf(stderr, "%-28s %-28s %9s %9s  %s\n", "link", "link", "shapes %", "spheres %",
               "verdict");
  for (const PairStatistics& pair : pairs) {
    std::fprintf(stderr, "%-28s %-28s %9.3f %9.3f  %s\n",
                 robot.links[static_cast<std::size_t>(pair.a)].name.c_str(),
                 robot.links[static_cast<std::size_t>(pair.b)].name.c_str(),
                 100.0 * pair.shapes_touch / samples, 100.0 * pair.spheres_touch / samples,
                 verdict_name(pair.verdict));
  }
}

Result<void> write_profile(const std::filesystem::path& file, const std::string& block) {
  return write_file(file, with_self_collision(SIDESTEP_TRY(read_file(file)), block));
}

Result<void> run(const Arguments& arguments) {
  const auto loaded = SIDESTEP_TRY(load_profile_robot(arguments.profile));

  const auto pairs = sample_pairs(*loaded.tree, arguments.sampling);
  const RobotDescription& robot = loaded.tree->description();
  print_table(robot, pairs, arguments.sampling.samples);
  const std::string block = self_collision_block(robot, pairs, arguments.sampling);
  if (arguments.write) return write_profile(loaded.file, block);
  std::fputs(block.c_str(), stdout);
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app("Finds the pairs of links that a robot's profile must check for self-collision");
  app.add_option("profile", arguments.profile, "The robot's name, or its profile's folder or file")
      ->required();
  app.add_option("--samples", arguments.sampling.samples, "Random configurations")
      ->check(CLI::Range(1, 100000000))
      ->capture_default_str();
  app.add_option("--margin", arguments.sampling.margin_m, "Distance in m that counts as touching")
      ->check(number_range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--seed", arguments.sampling.seed, "Of the samples")->capture_default_str();
  app.add_flag("--write", arguments.write, "Write the result into the profile");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  if (const auto done = run(arguments); !done) {
    std::fprintf(stderr, "%s\n", done.error().describe().c_str());
    return done.error().code == ErrorCode::kIo ? 4 : 2;
  }
  return 0;
}
