#include "ros_world.hpp"

#include <csignal>
#include <fstream>
#include <stdexcept>

namespace sidestep::testing {
namespace {

constexpr const char* kTools = "/usr/bin/";
constexpr const char* kPython = "/usr/bin/python3";  // The one that Debian's ROS is for.
constexpr double kStartPatience_s = 30.0;
constexpr double kSummaryPatience_s = 60.0;

nlohmann::json read_json(const std::filesystem::path& file) {
  std::ifstream in(file);
  return nlohmann::json::parse(in, nullptr, false);
}

}  // namespace

RosWorld::RosWorld() : port_(free_port()) {}

bool RosWorld::is_possible() { return has_tool("rosmaster"); }

bool RosWorld::has_tool(const std::string& name) {
  return std::filesystem::exists(kTools + name) && std::filesystem::exists(kPython);
}

std::unique_ptr<ChildProcess> RosWorld::start_tool(const std::string& name,
                                                   const std::vector<std::string>& command) const {
  std::vector<std::string> run{kPython, kTools + command.front()};
  run.insert(run.end(), command.begin() + 1, command.end());
  return start_program(name, run);
}

std::map<std::string, std::string> RosWorld::environment() const {
  return {
      {"ROS_MASTER_URI", "http://127.0.0.1:" + std::to_string(port_)},
      {"ROS_HOSTNAME", "127.0.0.1"},
      {"ROS_HOME", folder_.path() / "ros"},
      {"ROS_LOG_DIR", folder_.path() / "ros"},
      {"ROS_PACKAGE_PATH", SIDESTEP_SOURCE_DIR "/configs/ros1"},
      {"PATH", std::filesystem::path(SIDESTEP_COMMAND).parent_path().string() + ":/usr/bin:/bin"},
      {"SIDESTEP_PLUGIN_PATH", ""}};
}

void RosWorld::start_master() {
  std::filesystem::create_directories(folder_.path() / "ros");
  master_ = start_tool("master", {"rosmaster", "--core", "-p", std::to_string(port_)});
}

void RosWorld::start_fake(const std::string& scene, const std::vector<std::string>& options) {
  std::vector<std::string> command{
      FAKE_HSR,   scene, "--camera-rate", "10",    "--width",   "160",
      "--height", "120", "--focal",       "138.6", "--summary", folder_.path() / "fake.json"};
  command.insert(command.end(), options.begin(), options.end());
  fake_ = std::make_unique<ChildProcess>(command, environment(), folder_.path() / "fake.log");
  if (!fake_->says("fake_hsr: up", kStartPatience_s)) {
    throw std::runtime_error("no fake HSR: " + fake_->log() +
                             "; master: " + (master_ ? master_->log() : ""));
  }
}

void RosWorld::start_run(const std::string& configuration, const std::vector<std::string>& set) {
  std::vector<std::string> command{
      SIDESTEP_COMMAND, "run",
      std::string(SIDESTEP_SOURCE_DIR) + "/configs/ros1/" + configuration + ".yaml", "--out",
      run_folder()};
  std::vector<std::string> values{"mapper.resolution_m=0.05", "mapper.size_vox=[128, 128, 40]",
                                  "replanner.margin_m=0.045", "executor.mode=drive"};
  values.insert(values.end(), set.begin(), set.end());
  for (const std::string& value : values) {
    command.push_back("--set");
    command.push_back(value);
  }
  run_ = std::make_unique<ChildProcess>(command, environment(), folder_.path() / "run.log");
}

void RosWorld::start(const std::string& configuration, const std::string& scene,
                     const std::vector<std::string>& fake_options,
                     const std::vector<std::string>& set) {
  start_master();
  start_fake(scene, fake_options);
  start_run(configuration, set);
}

bool RosWorld::say(const std::vector<std::string>& words) {
  constexpr double kPatience_s = 20.0;
  std::vector<std::string> command{ROS_SAY};
  command.insert(command.end(), words.begin(), words.end());
  return start_program("said", command)->wait(kPatience_s) == 0;
}

std::unique_ptr<ChildProcess> RosWorld::start_program(
    const std::string& name, const std::vector<std::string>& command) const {
  return std::make_unique<ChildProcess>(command, environment(), folder_.path() / (name + ".log"));
}

nlohmann::json RosWorld::end_fake() {
  fake_->send(SIGTERM);
  if (fake_->wait(kSummaryPatience_s) != 0) return nullptr;
  return read_json(folder_.path() / "fake.json");
}

nlohmann::json RosWorld::run_summary() const { return read_json(run_folder() / "summary.json"); }

}  // namespace sidestep::testing
