#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "child_process.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {

/// A ROS master on a loopback port of its own, a fake HSR and a `sidestep` that drives it.
class RosWorld {
 public:
  RosWorld();

  /// Begins a run of configs/ros1/`configuration` at the size of two cores: images of 160 x 120
  /// ten times a second, voxels of 5 cm. `scene`: a file's path, or a name of configs/scenes;
  /// `set`: further overrides.
  void start(const std::string& configuration, const std::string& scene,
             const std::vector<std::string>& fake_options, const std::vector<std::string>& set);
  void start_master();
  void start_fake(const std::string& scene, const std::vector<std::string>& options);
  void start_run(const std::string& configuration, const std::vector<std::string>& set);

  /// Runs tests/ros/say with these words; whether somebody listened.
  [[nodiscard]] bool say(const std::vector<std::string>& words);
  /// Starts a program in this world, which ends with what is returned; its log is `name`.log.
  [[nodiscard]] std::unique_ptr<ChildProcess> start_program(
      const std::string& name, const std::vector<std::string>& command) const;

  /// Starts one of these, `command` being its name and arguments.
  [[nodiscard]] std::unique_ptr<ChildProcess> start_tool(
      const std::string& name, const std::vector<std::string>& command) const;

  [[nodiscard]] ChildProcess& master() { return *master_; }
  [[nodiscard]] ChildProcess& fake() { return *fake_; }
  [[nodiscard]] ChildProcess& run() { return *run_; }
  /// Ends the fake, and what it says of what happened; null where it does not say.
  [[nodiscard]] nlohmann::json end_fake();
  /// Where the run's results lie.
  [[nodiscard]] std::filesystem::path run_folder() const { return folder_.path() / "run"; }
  /// summary.json of the run; null where there is none.
  [[nodiscard]] nlohmann::json run_summary() const;

  /// Whether what this needs is there.
  [[nodiscard]] static bool is_possible();
  static constexpr const char* kMissing = "install python3-rosmaster";
  /// Whether Debian's ROS has a command of that name, which are programs in Python.
  [[nodiscard]] static bool has_tool(const std::string& name);

 private:
  [[nodiscard]] std::map<std::string, std::string> environment() const;

  testing_support::TemporaryFolder folder_;
  int port_;
  std::unique_ptr<ChildProcess> master_;
  std::unique_ptr<ChildProcess> fake_;
  std::unique_ptr<ChildProcess> run_;
};

}  // namespace sidestep::testing
