#include <algorithm>
#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

#include <sidestep/core/format.hpp>

#include "commands.hpp"
#include "urdf_comparison.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

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

void print_json(const std::string& robot, const std::string& urdf,
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

void print_row(const std::string& link, const char* what, const StandingOut& out) {
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
    if (one.shapes) print_row(name, "shapes", *one.shapes);
    print_row(one.shapes ? "" : name, "spheres", one.spheres);
  }
  std::printf("\n");
}

}  // namespace

ExitCode against_command(const RobotOptions& options, const KinematicTree& robot) {
  const std::string urdf = options.against->string();
  const auto comparison = compare_with_urdf(robot, urdf, options.package_paths);
  if (!comparison) {
    print_errors({comparison.error()});
    return ExitCode::kConfiguration;
  }
  if (options.json) {
    print_json(robot.description().name, urdf, *comparison);
  } else {
    print_poses(*comparison);
    print_links(*comparison);
    for (const std::string& note : comparison->notes) std::printf("note: %s\n", note.c_str());
    for (const std::string& one : comparison->findings) std::printf("finding: %s\n", one.c_str());
    std::printf("%s\n", verdict(*comparison, urdf).c_str());
  }
  return comparison->findings.empty() ? ExitCode::kSuccess : ExitCode::kTaskFailed;
}

}  // namespace sidestep
