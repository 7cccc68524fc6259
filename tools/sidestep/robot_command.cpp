#include <condition_variable>
#include <cstdio>
#include <mutex>

#include <nlohmann/json.hpp>

#include <sidestep/core/format.hpp>
#include <sidestep/runtime/install_layout.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "commands.hpp"
#include "cover_fit.hpp"
#include "sphere_cover.hpp"
#include "sphere_desk.hpp"
#include "stop_on_signal.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

ExitCode refused(const Error& error) {
  print_errors({error});
  return error.code == ErrorCode::kIo ? ExitCode::kFault : ExitCode::kConfiguration;
}

const char* type_name(Joint::Type type) noexcept {
  switch (type) {
    case Joint::Type::kRevolute: return "revolute";
    case Joint::Type::kContinuous: return "continuous";
    case Joint::Type::kPrismatic: return "prismatic";
  }
  return "";
}

void print_row(const std::string& name, const Cover& cover) {
  std::printf("%-30s %7d %9.2f %9.2f %9.1f %9.1f %9.3f %9.3f\n", name.c_str(), cover.spheres,
              100.0 * cover.surface_share, 100.0 * cover.volume_share, 1e3 * cover.gap_m,
              1e3 * cover.protrusion_m, 1e3 * cover.shapes_m3, 1e3 * cover.excess_m3);
}

void print_cover(const RobotDescription& robot, const RobotCover& cover) {
  std::printf("%-30s %7s %9s %9s %9s %9s %9s %9s\n", "link", "spheres", "surface %", "volume %",
              "gap mm", "out mm", "shapes l", "excess l");
  for (const LinkCover& one : cover.links) {
    print_row(robot.links[static_cast<std::size_t>(one.link)].name, one.cover);
  }
  print_row("all", cover.whole);
}

void print_joints(const RobotDescription& robot) {
  std::printf("%s: %d planned joints\n", robot.name.c_str(), robot.dof());
  for (const Joint& joint : robot.joints) {
    std::printf("  %-28s %-10s %s to %s %s, %s %s/s\n", joint.name.c_str(), type_name(joint.type),
                format("%.4g", joint.lower).c_str(), format("%.4g", joint.upper).c_str(),
                joint.unit(), format("%.4g", joint.max_velocity).c_str(), joint.unit());
  }
  std::printf("\n");
}

void print_json(const RobotDescription& robot, const RobotCover& cover) {
  Json json = {{"robot", robot.name}, {"joints", Json::array()}};
  for (const Joint& joint : robot.joints) json["joints"].push_back(joint.name);
  json.update(cover_json(cover));
  for (Json& link : json["links"]) {
    link["link"] = robot.links[link["link"].get<std::size_t>()].name;
  }
  std::printf("%s\n", json.dump(2).c_str());
}

/// Says what these spheres are to the robot.
void tell(const RobotOptions& options, const RobotDescription& robot, const RobotCover& cover) {
  if (options.json) return print_json(robot, cover);
  if (!options.fit) print_joints(robot);
  print_cover(robot, cover);
}

ExitCode edit_spheres(const RobotOptions& options, SphereProfile& profile, Console& console,
                      const std::stop_token& stop) {
  if (const auto fine = profile.check_writable(); !fine) return refused(fine.error());
  SphereDesk desk(profile);
  const auto server = serve_view(options.view, console, {}, &desk);
  if (!server) return refused(server.error());
  console.info("spheres are saved into " + profile.target().string() + "; Ctrl-C ends it");
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  never.wait(lock, stop, [] { return false; });
  return ExitCode::kSuccess;
}

ExitCode fit_spheres_of(const RobotOptions& options, SphereProfile& profile, Console& console,
                        const std::stop_token& stop) {
  const bool saves = options.write || options.out;
  if (saves) {
    if (const auto fine = profile.check_writable(); !fine) return refused(fine.error());
  }
  const KinematicTree& robot = *profile.robot();
  const auto bodies = rigid_bodies(robot);
  FitGoal goal;
  goal.protrusion_m = options.protrusion_m;
  goal.most_spheres = options.spheres;
  const auto spheres = fit_cover(bodies, robot.description().spheres, goal, stop);
  if (stop.stop_requested()) return ExitCode::kFault;
  const RobotCover cover = measure_cover(bodies, spheres);
  tell(options, robot.description(), cover);
  if (!options.spheres && cover.whole.protrusion_m > options.protrusion_m) {
    console.warn(format("the spheres stand out by %.4f m all the same: %d on a link are the most",
                        cover.whole.protrusion_m, FitGoal::kMostSpheresOnLink));
  }
  if (!saves) return ExitCode::kSuccess;
  if (const auto saved = profile.save(spheres); !saved) return refused(saved.error());
  console.info("saved into " + profile.target().string());
  return ExitCode::kSuccess;
}

}  // namespace

ExitCode robot_command(const RobotOptions& options) {
  const StopOnSignal stop;
  Console console;
  if (options.out && !options.fit && !options.edit) {
    return refused({ErrorCode::kConfig, "there is nothing to save",
                    "--out " + options.out->string(), "add --fit or --spheres", nullptr});
  }
  const SteadyWallClock clock;
  WorkerPool workers(1);
  const YamlDocumentReader documents;
  const HostContext context{console, clock, workers, documents, 0, {install_layout().robots},
                            {},      {}};
  auto profile = SphereProfile::open(options.profile, options.out, context);
  if (!profile) return refused(profile.error());
  if (options.against) return against_command(options, *profile->robot());
  if (options.edit) return edit_spheres(options, *profile, console, stop.token());
  if (options.fit) return fit_spheres_of(options, *profile, console, stop.token());
  const RobotDescription& robot = (*profile).robot()->description();
  tell(options, robot, measure_cover(rigid_bodies(*(*profile).robot()), robot.spheres));
  return ExitCode::kSuccess;
}

}  // namespace sidestep
