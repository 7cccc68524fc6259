#include <cstdio>
#include <fstream>

#include <nlohmann/json.hpp>

#include <sidestep/core/format.hpp>
#include <sidestep/runtime/install_layout.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "certify.hpp"
#include "commands.hpp"
#include "sphere_profile.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

const char* name_of(Certification::Outcome outcome) noexcept {
  switch (outcome) {
    case Certification::Outcome::kProven: return "proven";
    case Certification::Outcome::kRefuted: return "refuted";
    case Certification::Outcome::kUndecided: return "undecided";
  }
  return "";
}

Json point(const Eigen::Vector3d& p) { return Json::array({p.x(), p.y(), p.z()}); }

const char* name_of(Joining joining) noexcept {
  switch (joining) {
    case Joining::kLinear: return "linear";
    case Joining::kCubic: return "cubic";
    case Joining::kQuintic: return "quintic";
  }
  return "";
}

Json verdict_json(const Certification& found, double margin_m, Joining joining) {
  Json json = {{"verdict", name_of(found.outcome)},
               {"joined", name_of(joining)},
               {"margin_m", margin_m},
               {"pairs", found.pairs},
               {"parts", found.parts}};
  if (!found.broken_limit.empty()) json["limit"] = found.broken_limit;
  if (const auto& witness = found.witness) {
    json["witness"] = {{"time_s", witness->time_s},
                       {"a", witness->a},
                       {"b", witness->b},
                       {"p_a_m", point(witness->p_a)},
                       {"p_b_m", point(witness->p_b)},
                       {"distance_m", witness->distance_m}};
  }
  for (const Undecided& one : found.undecided) {
    json["undecided"].push_back(
        {{"a", one.a}, {"b", one.b}, {"from_s", one.from_s}, {"to_s", one.to_s}});
  }
  return json;
}

std::string verdict_text(const Certification& found, double margin_m, Joining joining) {
  if (!found.broken_limit.empty()) return "refuted: " + found.broken_limit;
  if (const auto& witness = found.witness) {
    const Eigen::Vector3d p = 0.5 * (witness->p_a + witness->p_b);
    return "refuted: at " + format("%.6f s ", witness->time_s) + witness->a +
           (witness->distance_m == 0.0 ? " is in "
                                       : format(" is %.6f m from ", witness->distance_m)) +
           witness->b + format(" at (%.4f, ", p.x()) + format("%.4f, ", p.y()) +
           format("%.4f)", p.z());
  }
  if (!found.undecided.empty()) {
    const Undecided& first = found.undecided.front();
    return format("undecided: %zu pairs of shapes, first ", found.undecided.size()) + first.a +
           " and " + first.b + format(" from %.6f", first.from_s) +
           format(" to %.6f s", first.to_s);
  }
  return format("proven: more than %g m clear over all of its time, limits held (joined: ",
                margin_m) +
         name_of(joining) + format("; %zu pairs of shapes, ", found.pairs) +
         format("%zu parts)", found.parts);
}

Result<void> save(const std::filesystem::path& file, const Json& certificate) {
  std::ofstream out(file);
  out << certificate.dump() << "\n";
  if (out.flush()) return {};
  return fail(ErrorCode::kIo, "cannot be written", file.string());
}

}  // namespace

ExitCode certify_command(const CertifyOptions& options) {
  Console console;
  const SteadyWallClock clock;
  WorkerPool workers(1);
  const YamlDocumentReader documents;
  const HostContext context{console, clock, workers, documents, 0, {install_layout().robots},
                            {},      {}};
  const auto refused = [](const Error& error) {
    print_errors({error});
    return exit_code(error);
  };
  const auto profile = SphereProfile::open(options.robot, std::nullopt, context);
  if (!profile) return refused(profile.error());
  const KinematicTree& robot = *profile->robot();
  const auto scene = read_certified_scene(options.scene, robot.description());
  if (!scene) return refused(scene.error());
  const auto motion = read_motion(options.motion, robot.description(), options.joining);
  if (!motion) return refused(motion.error());
  const auto found =
      certify(robot, *scene, *motion,
              {.margin_m = options.margin_m, .wants_certificate = options.out.has_value()});
  if (!found) return wrong_input(found.error());

  const bool is_proven = found->outcome == Certification::Outcome::kProven;
  if (options.out && is_proven) {
    if (const auto saved = save(*options.out, found->certificate); !saved) {
      return refused(saved.error());
    }
  }
  const std::string text = options.json
                               ? verdict_json(*found, options.margin_m, motion->joining).dump(2)
                               : verdict_text(*found, options.margin_m, motion->joining);
  std::printf("%s\n", text.c_str());
  if (is_proven) return ExitCode::kSuccess;
  return found->outcome == Certification::Outcome::kRefuted ? ExitCode::kTaskFailed
                                                            : ExitCode::kUndecided;
}

}  // namespace sidestep
