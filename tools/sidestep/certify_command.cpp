#include <cstdio>
#include <fstream>
#include <mutex>
#include <set>
#include <thread>

#include <nlohmann/json.hpp>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/runtime/install_layout.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "commands.hpp"
#include "inputs.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

Json point(const Eigen::Vector3d& p) { return Json::array({p.x(), p.y(), p.z()}); }

const char* name_of(Joining joining) noexcept {
  switch (joining) {
    case Joining::kLinear: return "linear";
    case Joining::kCubic: return "cubic";
    case Joining::kQuintic: return "quintic";
  }
  return "";
}

Json verdict_json(const std::string& motion, const Certification& found, double margin_m,
                  Joining joining) {
  Json json = {{"motion", motion},           {"verdict", name_of(found.outcome)},
               {"joined", name_of(joining)}, {"margin_m", margin_m},
               {"pairs", found.pairs},       {"parts", found.parts}};
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

std::string verdict_text(const Certification& found, double margin_m,
                         const PolynomialMotion& motion) {
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
  return format("proven: more than %g m clear over all of its ", margin_m) +
         (motion.has_times ? "time, limits held" : "way, limits of position held") +
         " (joined: " + name_of(motion.joining) + format("; %zu pairs of shapes, ", found.pairs) +
         format("%zu parts)", found.parts);
}

Result<void> save(const std::filesystem::path& file, const std::string& certificate) {
  std::ofstream out(file);
  out << certificate << "\n";
  if (out.flush()) return {};
  return fail(ErrorCode::kIo, "cannot be written", file.string());
}

/// Motions that are certified side by side, each with its verdict.
class Batch {
 public:
  Batch(const CertifyOptions& options, const KinematicTree& robot, const CertifiedScene& scene,
        std::vector<NamedMotion> motions)
      : options_(options),
        robot_(robot),
        scene_(scene),
        motions_(std::move(motions)),
        found_(motions_.size()) {}

  void run(WorkerPool& workers, Console& console) {
    const CertifySettings settings{.margin_m = options_.margin_m,
                                   .wants_certificate = options_.out.has_value()};
    std::mutex mutex;
    std::int64_t done = 0;
    const auto count = static_cast<int>(motions_.size());
    workers.run(count, [&](int i) {
      found_[idx(i)] = certify(robot_, scene_, motions_[idx(i)].motion, settings);
      const std::lock_guard lock(mutex);
      if (count > 1) console.progress(++done, count, "motions");
    });
    console.end_progress();
  }

  /// Prints the verdicts and leaves certificates.
  [[nodiscard]] ExitCode conclude() {
    ExitCode worst = ExitCode::kSuccess;
    Json all = Json::array();
    for (std::size_t i = 0; i < motions_.size(); ++i) {
      const auto& [name, motion] = motions_[i];
      const auto& found = found_[i];
      if (!found) {
        Error error = found.error();
        if (error.where.empty()) error.where = name;
        worst = worse_verdict(worst, wrong_input(error));
        continue;
      }
      worst = worse_verdict(worst, exit_code_of(found->outcome));
      if (options_.out) {  // an earlier certificate is not of this motion
        std::error_code ignored;
        std::filesystem::remove(certificate_file(name), ignored);
      }
      if (options_.out && found->outcome == Certification::Outcome::kProven) {
        if (const auto saved = save(certificate_file(name), found->certificate); !saved) {
          print_errors({saved.error()});
          return exit_code(saved.error());
        }
      }
      if (options_.json) {
        all.push_back(verdict_json(name, *found, options_.margin_m, motion.joining));
      } else {
        const std::string prefix = are_several() ? name + ": " : "";
        std::printf("%s%s\n", prefix.c_str(),
                    verdict_text(*found, options_.margin_m, motion).c_str());
      }
    }
    if (options_.json) std::printf("%s\n", (all.size() == 1 ? all[0] : all).dump(2).c_str());
    return worst;
  }

  /// What a command ends with that has both: wrong input before a refutation, that before what is
  /// undecided.
  static ExitCode worse_verdict(ExitCode a, ExitCode b) {
    const auto rank = [](ExitCode code) {
      return code == ExitCode::kUndecided ? 0.5 : static_cast<double>(code);
    };
    return rank(a) < rank(b) ? b : a;
  }

 private:
  static ExitCode exit_code_of(Certification::Outcome outcome) {
    switch (outcome) {
      case Certification::Outcome::kProven: return ExitCode::kSuccess;
      case Certification::Outcome::kRefuted: return ExitCode::kTaskFailed;
      case Certification::Outcome::kUndecided: break;
    }
    return ExitCode::kUndecided;
  }
  [[nodiscard]] bool are_several() const {
    return options_.motions.size() > 1 || motions_.size() > 1;
  }
  /// The file itself for one motion; for several one in that folder.
  [[nodiscard]] std::filesystem::path certificate_file(const std::string& name) const {
    if (!are_several()) return *options_.out;
    return *options_.out / (std::filesystem::path(name).filename().string() + ".json");
  }

  const CertifyOptions& options_;
  const KinematicTree& robot_;
  const CertifiedScene& scene_;
  std::vector<NamedMotion> motions_;
  std::vector<Result<Certification>> found_;
};

/// All scenes as one.
Result<SceneInput> read_scenes(const CertifyOptions& options, const RobotDescription& robot) {
  SceneInput all;
  std::vector<SceneObject> objects;
  for (const auto& file : options.scenes) {
    auto one = SIDESTEP_TRY(read_certified_scene(file, robot, options.point_radius_m));
    const auto& more = one.apart_from.scene.objects();
    objects.insert(objects.end(), more.begin(), more.end());
    std::ranges::move(one.apart_from.swarms, std::back_inserter(all.apart_from.swarms));
    std::ranges::move(one.attached, std::back_inserter(all.attached));
  }
  all.apart_from.scene = Scene(std::move(objects));
  return all;
}

}  // namespace

ExitCode certify_command(const CertifyOptions& options) {
  Console console;
  const SteadyWallClock clock;
  WorkerPool workers(
      options.threads.value_or(std::max(1, static_cast<int>(std::thread::hardware_concurrency()))));
  const YamlDocumentReader documents;
  const HostContext context{console, clock, workers, documents, 0, {install_layout().robots},
                            {},      {}};
  const auto refused = [](const Error& error) {
    print_errors({error});
    return exit_code(error);
  };
  auto robot = read_certified_robot(options.robot, context);
  if (!robot) return refused(robot.error());
  const auto scene = read_scenes(options, (*robot)->description());
  if (!scene) return refused(scene.error());
  if (!scene->attached.empty()) {
    robot = carrying(**robot, scene->attached, options.scenes.front().string());
    if (!robot) return refused(robot.error());
  }
  ExitCode worst = ExitCode::kSuccess;
  std::vector<NamedMotion> motions;
  for (const auto& file : options.motions) {
    auto read = read_motions(file, (*robot)->description(), options.format);
    if (read) {
      std::ranges::move(*read, std::back_inserter(motions));
    } else {
      worst = Batch::worse_verdict(worst, refused(read.error()));
    }
  }
  if (options.out && (options.motions.size() > 1 || motions.size() > 1)) {
    std::set<std::filesystem::path> names;
    for (const NamedMotion& one : motions) {
      if (names.insert(std::filesystem::path(one.name).filename()).second) continue;
      return refused({ErrorCode::kConfig,
                      "another motion has a file of this name, and certificates "
                      "are called after them",
                      one.name,
                      {}});
    }
    std::error_code failed;
    std::filesystem::create_directories(*options.out, failed);
    if (failed) {
      return refused({ErrorCode::kIo,
                      "cannot be made a folder for certificates: " + failed.message(),
                      options.out->string(),
                      {}});
    }
  }
  Batch batch(options, **robot, scene->apart_from, std::move(motions));
  batch.run(workers, console);
  return Batch::worse_verdict(worst, batch.conclude());
}

}  // namespace sidestep
