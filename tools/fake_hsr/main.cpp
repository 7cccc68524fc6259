// A simulated HSR behind the ROS 1 topics of the real one, for tests and demonstrations.

#include <csignal>
#include <cstdio>
#include <fstream>

#include <CLI/CLI.hpp>

#include "fake_hsr.hpp"
#include "node.hpp"
#include "number_range.hpp"

namespace {

using namespace sidestep;

std::atomic<bool> g_end{false};

void on_signal(int) { g_end = true; }

void declare(CLI::App& app, fake_hsr::Settings& settings) {
  app.add_option("scene", settings.scene, "A scene's file or name")->required();
  app.add_option("--profile", settings.profile, "The robot's")->capture_default_str();
  app.add_option("--prefix", settings.prefix, "Of its topics")->capture_default_str();
  app.add_option("--pose", settings.pose, "Named pose in which it begins")->capture_default_str();
  app.add_option("--joint", settings.joints, "JOINT=POSITION, over the pose");
  app.add_option("--seed", settings.seed, "Of what is random in the scene")->capture_default_str();
  app.add_option("--state-rate", settings.state_rate_hz, "Of joint states, odometry, tf, in Hz")
      ->check(number_range(1.0, 500.0))
      ->capture_default_str();
  app.add_option("--camera-rate", settings.camera_rate_hz, "In Hz")
      ->check(number_range(0.1, 60.0))
      ->capture_default_str();
  app.add_option("--width", settings.width_px, "Of the image, in pixels")
      ->check(CLI::Range(8, 4096))
      ->capture_default_str();
  app.add_option("--height", settings.height_px)->check(CLI::Range(8, 4096))->capture_default_str();
  app.add_option("--focal", settings.focal_px, "Focal length, in pixels")
      ->check(number_range(1.0, 10000.0))
      ->capture_default_str();
  app.add_option("--encoding", settings.encoding, "Of the image")
      ->check(CLI::IsMember({"16UC1", "32FC1"}))
      ->capture_default_str();
  app.add_flag("--clouds", settings.clouds, "Publishes point clouds beside the images");
  app.add_option("--range", settings.range_max_m, "Of the camera, in m")
      ->check(number_range(0.01, 1000.0))
      ->capture_default_str();
  app.add_flag("--ideal", settings.is_ideal,
               "Exact depth at once, drives that do as they are told, odometry that is true");
  app.add_flag("!--scene-runs", settings.scene_waits,
               "The scene moves from the start, not from the first command on");
  app.add_option(
      "--silence", settings.silences,
      "PART@FROM[+FOR]: camera, laser, joint_states, odom, tf or controller falls silent, "
      "in s from the first command on");
  app.add_option("--allow", settings.allowed, "LINK:OBJECT that may touch")->capture_default_str();
  app.add_option("--summary", settings.summary, "Where to write what was touched, on SIGTERM");
}

Result<void> run(const fake_hsr::Settings& settings) {
  constexpr double kPatience_s = 10.0;
  SIDESTEP_TRY(ros1_node::join_ros(kPatience_s, 1.0, "fake_hsr"));
  auto fake = SIDESTEP_TRY(fake_hsr::FakeHsr::create(settings));
  std::fprintf(stderr, "fake_hsr: up\n");
  fake->run(g_end);
  if (settings.summary.empty()) return {};
  const auto summary = SIDESTEP_TRY(fake->summary());
  std::ofstream out(settings.summary);
  out << summary;
  out.close();
  if (!out) return fail(ErrorCode::kIo, "cannot be written", settings.summary.string());
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  fake_hsr::Settings settings;
  CLI::App app("A simulated HSR behind the ROS 1 topics of the real one");
  declare(app, settings);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  std::signal(SIGTERM, on_signal);
  std::signal(SIGINT, on_signal);
  if (const auto done = run(settings); !done) {
    std::fprintf(stderr, "fake_hsr: %s\n", done.error().describe().c_str());
    return done.error().code == ErrorCode::kConfig ? 2 : 4;
  }
  return 0;
}
