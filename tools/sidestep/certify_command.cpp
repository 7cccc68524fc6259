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

Json verdict_json(const std::string& motion, const Certification& found, std::size_t objects,
                  double margin_m, Joining joining) {
  Json json = {{"motion", motion},           {"verdict", name_of(found.outcome)},
               {"joined", name_of(joining)}, {"margin_m", margin_m},
               {"objects", objects},         {"pairs", found.pairs},
               {"parts", found.parts}};
  if (!found.broken_limit.empty()) json["limit"] = found.broken_limit;
  if (!found.surfaces.empty()) json["surfaces"] = found.surfaces;
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

/// An instant; of waypoints without times the two that it is between, which count from 1.
std::string instant(double time_s, const PolynomialMotion& motion) {
  if (motion.has_times) return format("%.6f s", time_s);
  const double before = std::min(std::floor(time_s), motion.duration_s() - 1.0);
  return format("%.6f of the way from waypoint %.0f to %.0f", time_s - before, before + 1.0,
                before + 2.0);
}

std::string verdict_text(const Certification& found, std::size_t objects, double margin_m,
                         const PolynomialMotion& motion) {
  if (!found.broken_limit.empty()) return "refuted: " + found.broken_limit;
  if (const auto& witness = found.witness) {
    const Eigen::Vector3d p = 0.5 * (witness->p_a + witness->p_b);
    return "refuted: at " + instant(witness->time_s, motion) + " " + witness->a +
           (witness->distance_m == 0.0 ? " is in "
                                       : format(" is %.6f m from ", witness->distance_m)) +
           witness->b + format(" at (%.4f, ", p.x()) + format("%.4f, ", p.y()) +
           format("%.4f)", p.z());
  }
  if (!found.undecided.empty()) {
    const Undecided& first = found.undecided.front();
    return format("undecided: %zu pairs of shapes, first ", found.undecided.size()) + first.a +
           " and " + first.b + " from " + instant(first.from_s, motion) + " on, to " +
           instant(first.to_s, motion);
  }
  std::string surfaces;
  for (const std::string& one : found.surfaces) surfaces += (surfaces.empty() ? "" : ", ") + one;
  if (!surfaces.empty()) surfaces = "; meshes that are not closed, and have no inside: " + surfaces;
  return format("proven: more than %g m clear over all of its ", margin_m) +
         (motion.has_times ? "time, limits held" : "way, limits of position held") +
         " (joined: " + name_of(motion.joining) +
         format("; %zu objects, %zu pairs of shapes, %zu parts)", objects, found.pairs,
                found.parts) +
         surfaces;
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

  /// Prints the verdicts and leaves certificates. `all`: what is to be printed before, as JSON.
  [[nodiscard]] ExitCode conclude(Json all) {
    ExitCode worst = ExitCode::kSuccess;
    const std::size_t objects = scene_.scene.objects().size() + scene_.swarms.size();
    for (std::size_t i = 0; i < motions_.size(); ++i) {
      const auto& [name, motion] = motions_[i];
      const auto& found = found_[i];
      if (!found) {
        Error error = found.error();
        if (error.where.empty()) error.where = name;
        worst = worse_verdict(worst, wrong_input(error));
        all.push_back({{"motion", name}, {"error", error.describe()}});
        continue;
      }
      worst = worse_verdict(worst, exit_code_of(found->outcome));
      if (options_.out && found->outcome == Certification::Outcome::kProven) {
        if (const auto saved = save(certificate_file(name), found->certificate); !saved) {
          print_errors({saved.error()});
          return exit_code(saved.error());
        }
      }
      if (options_.json) {
        all.push_back(verdict_json(name, *found, objects, options_.margin_m, motion.joining));
      } else {
        const std::string prefix = are_several() ? name + ": " : "";
        std::printf("%s%s\n", prefix.c_str(),
                    verdict_text(*found, objects, options_.margin_m, motion).c_str());
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

/// Removes earlier certificates: whatever comes of it now, they are not of these motions. Fails
/// where that, or writing them, would lose an input.
Result<void> remove_earlier(const CertifyOptions& options) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const bool is_folder = options.motions.size() > 1 || fs::is_directory(*options.out, ignored);
  if (is_folder && options.motions.size() == 1 && options.motions.front().extension() != ".bag") {
    return fail(ErrorCode::kConfig, "is a folder, and a motion's certificate is a file",
                options.out->string());
  }
  std::vector<fs::path> inputs = options.motions;
  inputs.insert(inputs.end(), options.scenes.begin(), options.scenes.end());
  inputs.emplace_back(options.robot.robot);
  if (options.robot.srdf) inputs.push_back(*options.robot.srdf);
  for (const fs::path& motion : options.motions) {
    const fs::path file =
        is_folder ? *options.out / (motion.filename().string() + ".json") : *options.out;
    for (const fs::path& input : inputs) {
      if (!fs::equivalent(file, input, ignored)) continue;
      return fail(ErrorCode::kConfig, "is read, and --out would overwrite it", input.string());
    }
    fs::remove(file, ignored);
  }
  return {};
}

/// All scenes as one.
Result<SceneInput> read_scenes(const CertifyOptions& options, const RobotDescription& robot) {
  SceneInput all;
  std::vector<SceneObject> objects;
  std::set<std::string> names;
  for (const auto& file : options.scenes) {
    auto one = SIDESTEP_TRY(read_certified_scene(file, robot, options.point_radius_m));
    const auto& more = one.apart_from.scene.objects();
    for (const SceneObject& object : more) {
      if (!names.contains(object.name)) continue;
      return fail(ErrorCode::kConfig, "another scene has an object '" + object.name + "', too",
                  file.string());
    }
    for (const SceneObject& object : more) names.insert(object.name);
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
  if (options.out) {
    if (const auto removed = remove_earlier(options); !removed) return refused(removed.error());
  }
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
  Json unread = Json::array();
  for (const auto& file : options.motions) {
    auto read = read_motions(file, (*robot)->description(), options.format);
    if (read) {
      std::ranges::move(*read, std::back_inserter(motions));
    } else {
      worst = Batch::worse_verdict(worst, refused(read.error()));
      unread.push_back({{"motion", file.string()}, {"error", read.error().describe()}});
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
  return Batch::worse_verdict(worst, batch.conclude(std::move(unread)));
}

}  // namespace sidestep
