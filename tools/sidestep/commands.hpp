#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/robot/kinematic_tree.hpp>

#include "live_view.hpp"
#include "session.hpp"

namespace sidestep {

struct RunOptions {
  std::vector<std::string> configurations;
  std::vector<std::string> overrides;  ///< "a.b=value"
  std::optional<std::filesystem::path> out;
  std::optional<std::string> shard;             ///< "i/n"
  std::optional<std::filesystem::path> resume;  ///< The folder of the run to go on with.
  int jobs = 1;                                 ///< Processes that share the work, a shard each.
  bool json = false;
  ViewOptions view;
  std::optional<std::filesystem::path> record;  ///< File that the one run is recorded into.
};
/// Runs each configuration; the worst of their exit codes.
[[nodiscard]] ExitCode run_command(const RunOptions& options);

/// Validates each configuration without running it.
[[nodiscard]] ExitCode check_command(const std::vector<std::string>& configurations,
                                     const std::vector<std::string>& overrides);

enum class PluginsFormat { kText, kJson, kMarkdown, kResults, kJsonSchema };

/// Lists the plugins that are there, or tells all about those of one name.
[[nodiscard]] ExitCode plugins_command(const std::optional<std::string>& name,
                                       PluginsFormat format);

/// Rebuilds the reports of finished runs, and compares several, or merges them into `merged` where
/// they are shards of one.
[[nodiscard]] ExitCode report_command(const std::vector<std::filesystem::path>& runs,
                                      const std::filesystem::path& comparison,
                                      const std::filesystem::path& merged);

/// Serves a recorded run in the viewer's page until a signal comes.
[[nodiscard]] ExitCode view_command(const std::filesystem::path& file, const ViewOptions& options);

struct RobotOptions {
  std::string profile;
  bool edit = false;  ///< In a browser.
  bool fit = false;
  double protrusion_m = 0.04;
  std::optional<int> spheres;                        ///< Instead: how many.
  bool write = false;                                ///< What was fitted, into the profile.
  std::optional<std::filesystem::path> out;          ///< Instead, into this new file.
  std::optional<std::filesystem::path> against;      ///< A URDF to hold the profile against.
  std::vector<std::filesystem::path> package_paths;  ///< For that URDF's meshes.
  bool json = false;
  ViewOptions view;
};
/// Says what a robot profile has, fits spheres to it, serves the sphere editor until a signal
/// comes, or holds the profile against a URDF.
[[nodiscard]] ExitCode robot_command(const RobotOptions& options);
/// Holds the profile against a URDF.
[[nodiscard]] ExitCode against_command(const RobotOptions& options, const KinematicTree& robot);

}  // namespace sidestep
