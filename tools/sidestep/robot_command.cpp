#include <algorithm>
#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include <sidestep/core/format.hpp>
#include <sidestep/runtime/install_layout.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "commands.hpp"
#include "cover_fit.hpp"
#include "load_robot.hpp"
#include "sphere_cover.hpp"
#include "sphere_desk.hpp"
#include "urdf_comparison.hpp"

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
    std::printf("  %-28s %-10s %.4g to %.4g %s, %.4g %s/s", joint.name.c_str(),
                type_name(joint.type), joint.lower, joint.upper, joint.unit(), joint.max_velocity,
                joint.unit());
    if (std::isfinite(joint.max_acceleration)) {
      std::printf(", %.4g %s/s^2, stops with %.4g %s/s^2", joint.max_acceleration, joint.unit(),
                  joint.braking(), joint.unit());
    } else {
      std::printf(", acceleration not known");
    }
    std::printf("\n");
  }
  std::printf("\n");
}

void print_json(const RobotDescription& robot, const RobotCover& cover) {
  Json json = {{"robot", robot.name}, {"joints", Json::array()}, {"limits", Json::object()}};
  const auto if_known = [](double limit) { return std::isfinite(limit) ? Json(limit) : Json(); };
  for (const Joint& joint : robot.joints) {
    json["joints"].push_back(joint.name);
    json["limits"][joint.name] = {{"velocity", joint.max_velocity},
                                  {"acceleration", if_known(joint.max_acceleration)},
                                  {"braking", if_known(joint.braking())}};
  }
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
                      const StopOnSignal& stop) {
  if (const auto fine = profile.check_writable(); !fine) return refused(fine.error());
  SphereDesk desk(profile);
  const auto server = serve_view(options.view, console, {}, &desk);
  if (!server) return refused(server.error());
  console.info("spheres are saved into " + profile.target().string() + "; Ctrl-C ends it");
  stop.wait();
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

double inside_share(const StandingOut& out) {
  return out.surface_m2 > 0.0 ? 1.0 - out.outside_m2 / out.surface_m2 : 1.0;
}

std::string verdict(const UrdfComparison& comparison, const std::string& urdf) {
  const std::size_t count = comparison.findings.size();
  if (count == 0) {
    const int bare = comparison.bare_links;
    return "checked: nothing of " + urdf +
           format(" stands out by more than %g mm", 1e3 * kMostStandingOut_m) +
           (bare == 0   ? ""
            : bare == 1 ? "; 1 link without collision shapes was not"
                        : "; " + std::to_string(bare) + " links without collision shapes were not");
  }
  return "not checked: " + std::to_string(count) + (count == 1 ? " finding" : " findings");
}

Json json_of(const StandingOut& out) {
  Json json = {{"inside_share", inside_share(out)}, {"outside_m2", out.outside_m2}};
  const bool is_somewhere = out.farthest_m > 0.0 && std::isfinite(out.farthest_m);
  json["farthest_m"] = std::isfinite(out.farthest_m) ? Json(out.farthest_m) : Json();
  json["at_most_m"] = std::isfinite(out.at_most_m) ? Json(out.at_most_m) : Json();
  json["p_link_m"] = is_somewhere ? Json(out.p_farthest) : Json();
  return json;
}

void print_comparison_json(const std::string& robot, const std::string& urdf,
                           const UrdfComparison& comparison) {
  Json json = {{"robot", robot},
               {"against", urdf},
               {"checked", comparison.findings.empty()},
               {"verdict", verdict(comparison, urdf)},
               {"limit_m", kMostStandingOut_m},
               {"findings", comparison.findings},
               {"notes", comparison.notes},
               {"configurations", comparison.configurations},
               {"poses", Json::array()},
               {"links", Json::array()}};
  for (const LinkOffset& one : comparison.offsets) {
    json["poses"].push_back(
        {{"link", one.link}, {"offset_m", one.offset_m}, {"turn_rad", one.turn_rad}});
  }
  for (const LinkAgainst& one : comparison.links) {
    json["links"].push_back({{"link", one.link},
                             {"with", one.with},
                             {"surface_m2", one.spheres.surface_m2},
                             {"shapes", one.shapes ? json_of(*one.shapes) : Json()},
                             {"spheres", json_of(one.spheres)}});
  }
  std::printf("%s\n", json.dump(2).c_str());
}

/// As far as is printed.
bool is_where_it_should(const LinkOffset& one) {
  return one.offset_m < 5e-7 && one.turn_rad < 5e-7;
}

void print_poses(const UrdfComparison& comparison) {
  if (comparison.offsets.empty()) return;
  std::printf("%zu links that both have, in %d configurations; not where the profile has them:%s\n",
              comparison.offsets.size(), comparison.configurations,
              std::ranges::all_of(comparison.offsets, is_where_it_should) ? " none" : "");
  for (const LinkOffset& one : comparison.offsets) {
    if (is_where_it_should(one)) continue;
    std::printf("  %-43s %9.3f mm %9.3f mrad\n", one.link.c_str(), 1e3 * one.offset_m,
                1e3 * one.turn_rad);
  }
  std::printf("\n");
}

void print_standing_out(const std::string& link, const char* what, const StandingOut& out) {
  std::printf("%-45s %-8s %9.1f %9.2f %9.1f ", link.c_str(), what, 1e4 * out.surface_m2,
              100.0 * inside_share(out), 1e4 * out.outside_m2);
  const Eigen::Vector3d& p = out.p_farthest;
  if (std::isinf(out.farthest_m)) {
    std::printf("%9s\n", "all");
  } else if (out.farthest_m > 0.0) {
    std::printf("%9.1f  %.3f %.3f %.3f\n", 1e3 * out.farthest_m, p.x(), p.y(), p.z());
  } else {
    std::printf("%9.1f\n", 0.0);
  }
}

void print_links(const UrdfComparison& comparison) {
  if (comparison.links.empty()) return;
  std::printf("%-45s %-8s %9s %9s %9s %9s  %s\n", "link", "in", "cm2", "in %", "out cm2", "out mm",
              "at x y z, m");
  for (const LinkAgainst& one : comparison.links) {
    const std::string name = one.link == one.with ? one.link : one.link + " (" + one.with + ")";
    if (one.shapes) print_standing_out(name, "shapes", *one.shapes);
    print_standing_out(one.shapes ? "" : name, "spheres", one.spheres);
  }
  std::printf("\n");
}

/// Holds the profile against a URDF.
ExitCode against_command(const RobotOptions& options, const KinematicTree& robot) {
  const std::string urdf = options.against->string();
  const auto comparison = compare_with_urdf(robot, urdf, options.package_paths);
  if (!comparison) return wrong_input(comparison.error());
  if (options.json) {
    print_comparison_json(robot.description().name, urdf, *comparison);
  } else {
    print_poses(*comparison);
    print_links(*comparison);
    for (const std::string& note : comparison->notes) std::printf("note: %s\n", note.c_str());
    for (const std::string& one : comparison->findings) std::printf("finding: %s\n", one.c_str());
    std::printf("%s\n", verdict(*comparison, urdf).c_str());
  }
  return comparison->findings.empty() ? ExitCode::kSuccess : ExitCode::kTaskFailed;
}

/// A URDF as it is, its shapes covered by spheres.
ExitCode show_urdf(const RobotOptions& options, const HostContext& context) {
  if (options.fit || options.edit || options.against) {
    return refused({ErrorCode::kConfig, "this is for profiles, and here is a URDF", options.profile,
                    "`sidestep robot new` makes a profile of it", nullptr});
  }
  urdf_robot::Options urdf;
  urdf.urdf = options.profile;
  const auto robot = urdf_robot::load_robot(urdf, context);
  if (!robot) return refused(robot.error());
  const RobotDescription& description = (*robot)->description();
  tell(options, description, measure_cover(rigid_bodies(**robot), description.spheres));
  return ExitCode::kSuccess;
}

ExitCode make_profile(const NewRobotOptions& options, const HostContext& context, Console& console,
                      const std::stop_token& stop) {
  const auto progress = [&](std::size_t done, std::size_t total, std::string_view what) {
    console.progress(static_cast<std::int64_t>(done), static_cast<std::int64_t>(total), what);
  };
  const auto made = make_robot_profile(options, context, progress, stop);
  console.end_progress();
  if (!made) return refused(made.error());
  const RobotDescription& robot = made->robot->description();
  print_joints(robot);
  print_cover(robot, measure_cover(rigid_bodies(*made->robot), robot.spheres));
  std::printf("\n%zu pairs of links are held against each other\n",
              robot.self_collision_pairs.size());
  for (const std::string& joint : made->held) std::printf("not planned: %s\n", joint.c_str());
  for (const std::string& note : made->notes) std::printf("note: %s\n", note.c_str());
  std::printf("written: %s\n", made->profile.c_str());
  return ExitCode::kSuccess;
}

}  // namespace

ExitCode robot_command(const RobotOptions& options) {
  const StopOnSignal stop;
  Console console;
  if (options.profile.empty() && !options.is_new) {
    return refused({ErrorCode::kConfig, "PROFILE is required", "robot",
                    "a name, a folder, a profile or a URDF; `robot new` makes a profile", nullptr});
  }
  if (options.out && !options.fit && !options.edit) {
    return refused({ErrorCode::kConfig, "there is nothing to save",
                    "--out " + options.out->string(), "add --fit or --spheres", nullptr});
  }
  const SteadyWallClock clock;
  WorkerPool workers(1);
  const YamlDocumentReader documents;
  const HostContext context{console, clock, workers, documents, 0, {install_layout().robots},
                            {},      {}};
  if (options.is_new) return make_profile(options.new_profile, context, console, stop.token());
  if (std::filesystem::path(options.profile).extension() == ".urdf") {
    return show_urdf(options, context);
  }
  auto profile = SphereProfile::open(options.profile, options.out, context);
  if (!profile) return refused(profile.error());
  if (options.against) return against_command(options, *profile->robot());
  if (options.edit) return edit_spheres(options, *profile, console, stop);
  if (options.fit) return fit_spheres_of(options, *profile, console, stop.token());
  const RobotDescription& robot = profile->robot()->description();
  tell(options, robot, measure_cover(rigid_bodies(*profile->robot()), robot.spheres));
  return ExitCode::kSuccess;
}

}  // namespace sidestep
