#include "new_robot.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <set>

#include <nlohmann/json.hpp>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

#include "build_robot.hpp"
#include "cover_fit.hpp"
#include "load_robot.hpp"
#include "pair_statistics.hpp"
#include "sphere_profile.hpp"
#include "srdf_file.hpp"
#include "urdf_file.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;
using urdf_robot::Srdf;
using urdf_robot::UrdfJoint;
using urdf_robot::UrdfModel;

/// Spheres that touch where the shapes do not are fitted closer, so often.
constexpr int kCloserFits = 3;
/// Meshes are slow to hold against each other.
constexpr int kSamples = 4000;
constexpr int kSamplesOfTold = 200;  ///< Where an SRDF says which pairs matter.

/// As YAML reads it back as a string: plain where it can be.
std::string quoted(const std::string& text) {
  const auto is_plain = [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '/' || c == '.' || c == '-';
  };
  const bool is_word = !text.empty() && std::isalpha(static_cast<unsigned char>(text[0])) != 0;
  return is_word && std::ranges::all_of(text, is_plain) ? text : nlohmann::json(text).dump();
}

class ProfileMaker {
 public:
  ProfileMaker(const NewRobotOptions& options, const HostContext& context,
               const NewRobotProgress& progress, const std::stop_token& stop)
      : options_(options), context_(context), progress_(progress), stop_(stop) {}

  [[nodiscard]] Result<NewRobot> run() {
    made_.profile = options_.out / "profile.yaml";
    if (fs::exists(made_.profile)) {
      return fail(ErrorCode::kIo, "there is a profile already", made_.profile.string());
    }
    std::vector<Error> errors;
    auto model = urdf_robot::read_urdf(options_.urdf, errors);
    if (!model) return tl::make_unexpected(urdf_robot::all_of(std::move(errors), "the URDF"));
    model_ = std::move(*model);
    if (options_.srdf) {
      srdf_ = SIDESTEP_TRY(urdf_robot::read_srdf(*options_.srdf));
      for (const auto& [element, count] : srdf_.passed_over) {
        made_.notes.push_back("of the SRDF is passed over: " + std::to_string(count) + " <" +
                              element + ">");
      }
    }
    SIDESTEP_TRY(choose_joints());
    find_groups();

    made_.robot = SIDESTEP_TRY(load());
    SIDESTEP_TRY(find_poses());
    SIDESTEP_TRY(find_disabled_pairs());
    SIDESTEP_TRY(fit());
    made_.robot = SIDESTEP_TRY(load());
    SIDESTEP_TRY(find_pairs());
    made_.robot = SIDESTEP_TRY(load());
    for (int round = 0; round < kCloserFits; ++round) {
      if (!SIDESTEP_TRY(fit_closer())) break;
      made_.robot = SIDESTEP_TRY(load());
    }
    std::error_code error;
    fs::create_directories(options_.out, error);
    std::ofstream out(made_.profile, std::ios::binary);
    out << text(options_.out);
    out.close();
    if (!out) return fail(ErrorCode::kIo, "cannot be written", made_.profile.string());
    return std::move(made_);
  }

 private:
  [[nodiscard]] bool is_stopped() const { return stop_.stop_requested(); }
  [[nodiscard]] static tl::unexpected<Error> stopped() {
    return fail(ErrorCode::kIo, "interrupted");
  }

  /// The joints of a group of the SRDF, those of its groups among them.
  [[nodiscard]] Result<void> add_group(const std::string& name, std::set<std::string>& joints,
                                       std::set<std::string>& seen) const {
    const auto group = std::ranges::find(srdf_.groups, name, &Srdf::Group::name);
    if (group == srdf_.groups.end()) {
      std::vector<std::string> names;
      for (const Srdf::Group& one : srdf_.groups) names.push_back(one.name);
      return fail(ErrorCode::kConfig, "there is no group '" + name + "'",
                  options_.srdf ? options_.srdf->string() : "--group",
                  options_.srdf ? did_you_mean(name, names) : "groups are those of --srdf");
    }
    if (!seen.insert(name).second) return {};
    for (const std::string& joint : group->joints) {
      if (!model_.find_joint(joint) && !srdf_.virtual_joints.contains(joint)) {
        return fail(ErrorCode::kConfig, "the URDF has no joint '" + joint + "'",
                    options_.srdf->string(), did_you_mean(joint, model_.joint_names()));
      }
      joints.insert(joint);
    }
    const auto add_joint_of = [&](int link) {
      const auto& joint = model_.links[idx(link)].joint;
      if (joint) joints.insert(joint->name);
    };
    const auto find = [&](const std::string& link) -> Result<int> {
      if (const auto index = model_.link_index(link)) return *index;
      return fail(ErrorCode::kConfig, "the URDF has no link '" + link + "'",
                  options_.srdf->string(), did_you_mean(link, model_.link_names()));
    };
    for (const std::string& link : group->links) add_joint_of(SIDESTEP_TRY(find(link)));
    for (const auto& [base, tip] : group->chains) {
      const int end = SIDESTEP_TRY(find(base));
      int link = SIDESTEP_TRY(find(tip));
      for (; link > 0 && link != end; link = model_.links[idx(link)].parent) add_joint_of(link);
      if (link == end) continue;
      return fail(ErrorCode::kConfig,
                  "no chain of joints leads from '" + base + "' to '" + tip + "'",
                  options_.srdf->string());
    }
    for (const std::string& one : group->groups) SIDESTEP_TRY(add_group(one, joints, seen));
    return {};
  }

  [[nodiscard]] Result<void> choose_joints() {
    std::set<std::string> wanted, seen;
    if (!options_.group.empty()) SIDESTEP_TRY(add_group(options_.group, wanted, seen));
    for (const auto& link : model_.links) {
      if (!link.joint || link.joint->type == UrdfJoint::Type::kFixed || link.joint->mimic) continue;
      const UrdfJoint& joint = *link.joint;
      const bool is_bounded = joint.type == UrdfJoint::Type::kContinuous ||
                              (joint.limits && joint.limits->lower < joint.limits->upper);
      const char* const reason =
          !options_.group.empty() && !wanted.contains(joint.name) ? "not of the group"
          : !is_bounded                                           ? "no limits of position"
          : !joint.limits || !(joint.limits->velocity > 0.0)      ? "no limit of velocity"
                                                                  : nullptr;
      if (reason == nullptr) {
        joints_.push_back(joint.name);
      } else {
        const bool has_range = joint.limits && joint.type != UrdfJoint::Type::kContinuous &&
                               joint.limits->lower <= joint.limits->upper;
        const double rest =
            has_range ? std::clamp(0.0, joint.limits->lower, joint.limits->upper) : 0.0;
        held_.push_back({joint.name, reason, rest});
        made_.held.push_back(joint.name + ": " + reason);
      }
    }
    if (!joints_.empty()) return {};
    return fail(ErrorCode::kConfig,
                "no joint is left to plan: " +
                    (made_.held.empty() ? "none moves" : made_.held.front() + ", and so on"),
                options_.urdf.string(),
                "a joint needs <limit lower= upper= velocity=>; give what is missing in the URDF");
  }

  /// Of the SRDF those that have some of the planned joints, but not all.
  void find_groups() {
    for (const Srdf::Group& group : srdf_.groups) {
      std::set<std::string> joints, seen;
      if (const auto found = add_group(group.name, joints, seen); !found) {
        made_.notes.push_back("group '" + group.name +
                              "' of the SRDF is left out: " + found.error().describe());
        continue;
      }
      std::vector<std::string> planned;
      for (const std::string& joint : joints_) {
        if (joints.contains(joint)) planned.push_back(joint);
      }
      if (planned.empty() || planned.size() == joints_.size()) continue;
      groups_.emplace_back(group.name, std::move(planned));
    }
  }

  /// Of the SRDF those that the planned joints have; else one at rest.
  [[nodiscard]] Result<void> find_poses() {
    const RobotDescription& robot = made_.robot->description();
    for (const Srdf::Pose& pose : srdf_.poses) {
      std::map<std::string, double> positions;
      for (const auto& [name, value] : pose.joints) {
        const auto joint = robot.joint_index(name);
        if (!joint && !model_.find_joint(name) && !srdf_.virtual_joints.contains(name)) {
          return fail(ErrorCode::kConfig,
                      "pose '" + pose.name + "': the URDF has no joint '" + name + "'",
                      options_.srdf->string(), did_you_mean(name, model_.joint_names()));
        }
        if (!joint) continue;
        const Joint& of = robot.joints[idx(*joint)];
        if (of.type != Joint::Type::kContinuous && !(value >= of.lower && value <= of.upper)) {
          made_.notes.push_back("pose '" + pose.name + "' of the SRDF is left out: " + name +
                                " would be beyond its limits");
          positions.clear();
          break;
        }
        positions[name] = value;
      }
      for (const auto& [joint, at] : positions) {  // of all groups that have a pose of this name
        if (poses_[pose.name].emplace(joint, at).second) continue;
        made_.notes.push_back("pose '" + pose.name + "' of the SRDF has " + joint +
                              " twice: the first is taken");
      }
    }
    if (!poses_.empty()) return {};
    for (const Joint& joint : robot.joints) {
      poses_["rest"][joint.name] = std::clamp(0.0, joint.lower, joint.upper);
    }
    return {};
  }

  [[nodiscard]] Result<void> fit() {
    const auto bodies = rigid_bodies(*made_.robot);
    std::set<int> links;
    for (const CollisionShape& shape : made_.robot->description().shapes) links.insert(shape.link);
    std::size_t done = 0;
    for (const int link : links) {
      progress_(done++, links.size(), "fitting spheres to " + name_of(link));
      spheres_ =
          fit_cover(bodies, spheres_, {.protrusion_m = options_.protrusion_m, .link = link}, stop_);
      if (is_stopped()) return stopped();
    }
    return {};
  }

  [[nodiscard]] Result<void> find_disabled_pairs() {
    const RobotDescription& robot = made_.robot->description();
    for (const Srdf::DisabledPair& one : srdf_.disabled) {
      const auto a = robot.link_index(one.a), b = robot.link_index(one.b);
      if (!a || !b) {
        const std::string& unknown = a ? one.b : one.a;
        return fail(ErrorCode::kConfig, "the URDF has no link '" + unknown + "'",
                    one.mark.to_string(), did_you_mean(unknown, model_.link_names()));
      }
      disabled_.insert(std::minmax(*a, *b));
    }
    return {};
  }

  [[nodiscard]] Result<void> find_pairs() {
    const KinematicTree& robot = *made_.robot;  // with the spheres: a link without has no shapes
    const bool is_told = !disabled_.empty();
    SamplingOptions sampling;
    sampling.samples = is_told ? kSamplesOfTold : kSamples;
    if (is_told) sampling.margin_m = 0.0;
    const auto sampled = sample_pairs(robot, sampling, [&](int done) {
      progress_(idx(done), idx(sampling.samples), "holding links against each other");
      return !is_stopped();
    });
    if (is_stopped()) return stopped();
    using Verdict = PairStatistics::Verdict;
    for (const PairStatistics& pair : sampled) {
      if (disabled_.contains({pair.a, pair.b})) continue;
      // What an SRDF does not disable is checked, unless nothing could ever be valid then.
      const bool is_always =
          is_told ? pair.shapes_touch == sampling.samples : pair.verdict == Verdict::kAlways;
      if (is_always) {
        made_.notes.push_back(
            name_of(pair.a) + " and " + name_of(pair.b) +
            " touch wherever the joints are, and are not held against each other");
      } else if (is_told || pair.verdict == Verdict::kChecked) {
        pairs_.emplace_back(pair.a, pair.b);
      }
    }
    return {};
  }

  /// Fits closer spheres to the links of pairs that touch in a pose by their spheres alone. Whether
  /// there were any.
  [[nodiscard]] Result<bool> fit_closer() {
    const KinematicTree& robot = *made_.robot;
    const RobotDescription& description = robot.description();
    std::set<int> links;
    for (const auto& [name, positions] : poses_) {
      std::vector<double> q(description.joints.size(), 0.0);
      for (std::size_t j = 0; j < q.size(); ++j) {
        const Joint& joint = description.joints[j];
        const auto at = positions.find(joint.name);
        q[j] = at != positions.end() ? at->second : std::clamp(0.0, joint.lower, joint.upper);
      }
      const auto touching = touching_pairs(robot, q);
      for (const auto& pair : touching_spheres(robot, pairs_, q)) {
        if (std::ranges::count(touching, pair) == 0) links.insert({pair.first, pair.second});
      }
    }
    const auto bodies = rigid_bodies(robot);
    bool is_any = false;
    std::size_t done = 0;
    for (const int link : links) {
      double& protrusion_m = protrusions_m_.try_emplace(link, options_.protrusion_m).first->second;
      protrusion_m *= 0.5;
      if (protrusion_m < FitGoal::kLeastProtrusion_m) continue;
      progress_(done++, links.size(), "fitting closer spheres to " + name_of(link));
      spheres_ = fit_cover(bodies, spheres_, {.protrusion_m = protrusion_m, .link = link}, stop_);
      if (is_stopped()) return stopped();
      is_any = true;
    }
    return is_any;
  }
  /// As it is so far, read back from a file that is gone afterwards.
  [[nodiscard]] Result<std::shared_ptr<const KinematicTree>> load() const {
    std::string folder = (fs::temp_directory_path() / "sidestep-robot-XXXXXX").string();
    if (mkdtemp(folder.data()) == nullptr) {
      return fail(ErrorCode::kIo, "no folder can be made there", folder);
    }
    std::ofstream(fs::path(folder) / "profile.yaml", std::ios::binary) << text(folder);
    urdf_robot::Options options;
    options.profile = Node(Node::Scalar{folder, true}, {"command line"});
    auto robot = urdf_robot::load_robot(options, context_);
    std::error_code ignored;
    fs::remove_all(folder, ignored);
    if (!robot) return tl::make_unexpected(std::move(robot.error()));
    return std::shared_ptr<const KinematicTree>(std::move(*robot));
  }

  [[nodiscard]] const std::string& name_of(int link) const {
    return made_.robot->description().links[idx(link)].name;
  }
  /// A path as it leads from the profile's folder.
  [[nodiscard]] static std::string path_from(const fs::path& folder, const fs::path& path) {
    std::error_code error;
    const fs::path relative = fs::relative(path, folder, error);
    return quoted((error || relative.empty() ? fs::absolute(path) : relative).string());
  }

  [[nodiscard]] std::string text(const fs::path& folder) const {
    using detail::number_text;
    std::string out = "# Made of " + options_.urdf.filename().string() +
                      "; docs/reference/robot_profiles.md has all keys.\n" +
                      "name: " + quoted(model_.name) +
                      "\nurdf: " + path_from(folder, options_.urdf);
    if (!options_.package_paths.empty()) out += "\npackage_paths:";
    for (const auto& [name, path] : urdf_robot::package_paths_of(options_.package_paths)) {
      const std::string there = path_from(folder, path);
      out += "\n  - " + (name.empty() ? there : "{" + quoted(name) + ": " + there + "}");
    }

    out +=
        "\n\n# The order of q. What the URDF does not say, as max_acceleration, joint_limits "
        "adds.\njoints:";
    for (const std::string& joint : joints_) out += "\n  - " + quoted(joint);
    if (!groups_.empty()) out += "\n\ngroups:";
    for (const auto& [name, joints] : groups_) {
      out += "\n  " + quoted(name) + ":";
      for (const std::string& joint : joints) out += "\n    - " + quoted(joint);
    }
    if (!held_.empty()) out += "\n\nfixed_joints:";
    for (const Held& one : held_) {
      out += "\n  " + quoted(one.joint) + ": " + number_text(one.rest) + "  # " + one.reason;
    }
    out += "\n\nposes:";
    for (const auto& [name, positions] : poses_) {
      out += "\n  " + quoted(name) + ":";
      for (const auto& [joint, at] : positions) {
        out += "\n    " + quoted(joint) + ": " + number_text(at);
      }
    }
    out += poses_.empty() ? " {}" : "";
    out += "\n\nself_collision:\n  pairs:";
    for (const auto& [a, b] : pairs_) {
      out += "\n    - [" + quoted(name_of(a)) + ", " + quoted(name_of(b)) + "]";
    }
    out += pairs_.empty() ? " []" : "";
    out += "\n\nspheres:\n";
    for (const CollisionSphere& sphere : spheres_) {
      out += "  " + sphere_item(sphere, made_.robot->description().links) + "\n";
    }
    if (spheres_.empty()) {  // none are fitted yet, and some have to be there
      out += "  - {link: " + quoted(model_.links.front().name) +
             ", centre_m: [0, 0, 0], radius_m: 0.01}\n";
    }
    return out;
  }

  struct Held {
    std::string joint;
    std::string reason;
    double rest = 0.0;
  };

  const NewRobotOptions& options_;
  const HostContext& context_;
  const NewRobotProgress& progress_;
  const std::stop_token& stop_;
  UrdfModel model_;
  Srdf srdf_;
  std::vector<std::string> joints_;
  std::vector<std::pair<std::string, std::vector<std::string>>> groups_;
  std::vector<Held> held_;
  std::map<std::string, std::map<std::string, double>> poses_;
  std::set<std::pair<int, int>> disabled_;  ///< By the SRDF.
  std::vector<std::pair<int, int>> pairs_;
  std::vector<CollisionSphere> spheres_;
  std::map<int, double> protrusions_m_;  ///< Of links whose spheres were fitted closer.
  NewRobot made_;
};

}  // namespace

Result<NewRobot> make_robot_profile(const NewRobotOptions& options, const HostContext& context,
                                    const NewRobotProgress& progress, const std::stop_token& stop) {
  return ProfileMaker(options, context, progress, stop).run();
}

}  // namespace sidestep
