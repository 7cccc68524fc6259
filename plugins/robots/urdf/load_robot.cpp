#include "load_robot.hpp"

#include <algorithm>
#include <utility>

#include "build_robot.hpp"
#include "urdf_file.hpp"

namespace sidestep::urdf_robot {
namespace {

/// `over`'s entries on top of `under`'s.
Node merged(const Node& under, const Node& over) {
  if (!under.is_map() || !over.is_map()) return over.is_null() ? under : over;
  Node out = under;
  for (const Node::Entry& entry : over.entries()) {
    if (Node* value = out.find(entry.key); value != nullptr) {
      *value = entry.value;
    } else {
      out.entries().push_back(entry);
    }
  }
  return out;
}

Profile profile_of(const Options& options) {
  Profile profile;
  profile.urdf = options.urdf;
  profile.base.type = options.base.value_or("fixed");
  profile.root_link = options.root_link;
  profile.tip_link = options.tip_link;
  profile.joints = options.joints;
  profile.joint_limits = options.joint_limits;
  profile.fixed_joints = options.fixed_joints;
  profile.package_paths = options.package_paths;
  profile.sphere_protrusion_m = options.sphere_protrusion_m;
  return profile;
}

/// The part of the model from `root` on. What the cut joints would have moved stays.
UrdfModel subtree(const UrdfModel& model, int root) {
  UrdfModel out{model.name, model.file, {}};
  std::vector<int> placed(model.links.size(), -1);
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const UrdfLink& link = model.links[i];
    const bool is_root = static_cast<int>(i) == root;
    const int parent = link.parent == -1 ? -1 : placed[static_cast<std::size_t>(link.parent)];
    if (!is_root && parent == -1) continue;
    placed[i] = static_cast<int>(out.links.size());
    out.links.push_back(link);
    out.links.back().parent = is_root ? -1 : parent;
    if (is_root) out.links.back().joint.reset();
  }
  return out;
}

bool moves(const UrdfJoint& joint) { return joint.type != UrdfJoint::Type::kFixed; }

/// Whether a joint follows `name`, itself or through others.
bool follows(const UrdfModel& model, const UrdfJoint& joint, const std::string& name) {
  const UrdfJoint* at = &joint;
  for (std::size_t i = 0; i <= model.links.size() && at != nullptr; ++i) {
    if (at->name == name) return true;
    at = at->mimic ? model.find_joint(at->mimic->joint) : nullptr;
  }
  return false;
}

/// Lays the profile's couplings over the URDF's.
void couple(const Node& couplings, UrdfModel& model, std::vector<Error>& errors) {
  if (!couplings.is_map() && !couplings.is_null()) {
    errors.push_back(
        couplings.error("'coupled_joints' is a map from joints to what they follow, "
                        "found " +
                        couplings.kind()));
  }
  const Parameters<CoupledJointOptions> fields = CoupledJointOptions::parameters();
  const auto unknown = [&](const Node& where, const std::string& name) {
    errors.push_back(where.error("the URDF has no moving joint '" + name + "'",
                                 did_you_mean(name, model.joint_names())));
  };
  for (const Node::Entry& entry : couplings.entries()) {
    const Node key(Node::Scalar{entry.key, false}, entry.key_mark);
    const std::size_t before = errors.size();
    check_against_schema(entry.value, fields.schema(), {}, errors);
    if (errors.size() != before) continue;
    CoupledJointOptions coupling;
    fields.read(entry.value, coupling, errors);
    const auto link = std::ranges::find_if(model.links, [&](const UrdfLink& one) {
      return one.joint && one.joint->name == entry.key && moves(*one.joint);
    });
    const UrdfJoint* other = model.find_joint(coupling.joint);
    if (link == model.links.end()) {
      unknown(key, entry.key);
    } else if (other == nullptr || !moves(*other)) {
      unknown(*entry.value.find("joint"), coupling.joint);
    } else if (follows(model, *other, entry.key)) {
      errors.push_back(key.error("joint '" + entry.key + "' would follow itself"));
    } else {
      link->joint->mimic = UrdfMimic{coupling.joint, coupling.multiplier, coupling.offset};
    }
  }
}

std::optional<UrdfModel> read_model(const Profile& profile, std::vector<Error>& errors) {
  auto model = read_urdf(profile.urdf, errors);
  if (model) couple(profile.coupled_joints, *model, errors);
  if (!model || profile.root_link.empty()) return model;
  if (const auto root = model->link_index(profile.root_link)) return subtree(*model, *root);
  errors.push_back({ErrorCode::kConfig, "the URDF has no link '" + profile.root_link + "'",
                    profile.urdf.string(), did_you_mean(profile.root_link, model->link_names())});
  return {};
}

/// What was read, counted, for the log.
std::string counts_of(const UrdfModel& model, const Profile& profile, const KinematicTree& robot) {
  std::size_t joints = 0, shapes = 0;
  for (const UrdfLink& link : model.links) {
    joints += link.joint ? 1 : 0;
    shapes += link.shapes.size();
  }
  const RobotDescription& made = robot.description();
  const auto counted = [](std::size_t count, const char* what) {
    return std::to_string(count) + " " + what;
  };
  std::string text = "read " + profile.urdf.string() + ": ";
  if (!profile.root_link.empty()) text += "from link '" + profile.root_link + "' on ";
  text += counted(model.links.size(), "links, ") + counted(joints, "joints, ") +
          counted(shapes, "shapes");
  if (profile.shapes_from == "spheres") text += ", none of them used: shapes_from is spheres";
  const bool has_file = !profile.document.is_null();
  text += "; " + (has_file ? "read " + profile.document.mark().file + ": " : std::string()) +
          counted(made.joints.size(), "planned joints, ") +
          counted(made.spheres.size(), "spheres, ") + counted(made.poses.size(), "poses, ") +
          counted(made.self_collision_pairs.size(), "pairs of links");
  return text;
}

}  // namespace

Parameters<Options> Options::parameters() {
  using T = Options;
  return Parameters<T>()
      .add("profile", &T::profile,
           "The robot's profile: its name, its folder, or its file. Either this or 'urdf'.")
      .add("group", &T::group,
           "With 'profile': plans the joints of this group of it alone; the others are held.")
      .add("held", &T::held,
           "With 'group': the pose of the profile in which the others are held, but for those that "
           "'fixed_joints' names. Where neither says anything of a joint, it is at 0, or the limit "
           "nearest to it. Poses in which a held joint is elsewhere are left out.")
      .add("mount", &T::mount,
           "Where the root link is of a robot without a base that drives: {position_m, rpy_rad}, "
           "world frame; in place of the profile's.")
      .add("urdf", &T::urdf, "A URDF to be used as it is, its collision shapes covered by spheres.")
      .add("base", &T::base, "With 'urdf': whether the root link is fixed or drives in its plane.",
           {.choices = {"fixed", "holonomic", "differential"}})
      .add("root_link", &T::root_link, "With 'urdf': takes only the part from this link on.")
      .add("tip_link", &T::tip_link,
           "With 'urdf', without 'joints': plans the joints between the root and this link.")
      .add("joints", &T::joints,
           "With 'urdf': the planned joints in the order of q; all that move if empty.")
      .add("joint_limits", &T::joint_limits,
           "A map from joints to {lower, upper, max_velocity, max_acceleration, max_braking}; "
           "replaces what the "
           "profile or the URDF says.")
      .add("fixed_joints", &T::fixed_joints,
           "A map from joints that are not planned to where they stay, in m or rad; over the "
           "profile's.")
      .add("package_paths", &T::package_paths,
           "Folders in which package://NAME/... is looked for as NAME/...; {NAME: FOLDER} is that "
           "package itself.")
      .add("sphere_protrusion_m", &T::sphere_protrusion_m,
           "With 'urdf': how far the spheres may stand out from the shapes.",
           {.unit = "m", .min = 0.001, .max = 1.0});
}

std::vector<OptionMistake> Options::check() const {
  std::vector<OptionMistake> mistakes;
  if (group.is_null() && !held.is_null()) {
    mistakes.push_back({{"held"}, "stands without 'group', and all joints are planned", {}});
  }
  if (profile.is_null()) {
    if (urdf.empty()) return {{{}, "the robot needs either 'profile' or 'urdf'", {}}};
    if (group.is_null()) return mistakes;
    return {{{"group"}, "stands without 'profile', which has the groups", "name 'joints'"}};
  }
  for (const auto& [name, is_set] :
       {std::pair("urdf", !urdf.empty()), std::pair("base", base.has_value()),
        std::pair("root_link", !root_link.empty()), std::pair("tip_link", !tip_link.empty()),
        std::pair("joints", !joints.empty())}) {
    if (!is_set) continue;
    mistakes.push_back({{name}, "cannot stand beside 'profile', which has its own", {}});
  }
  return mistakes;
}

Result<std::unique_ptr<KinematicTree>> load_robot(const Options& options,
                                                  const HostContext& context) {
  Profile profile;
  std::vector<Error> errors;
  std::string what = "the URDF";
  if (options.profile.is_null()) {
    profile = profile_of(options);
    profile.spheres_from = "fit";
  } else {
    const auto file = SIDESTEP_TRY(find_profile(options.profile, context.robot_paths));
    what = "the robot profile";
    profile = read_profile(file, context.documents, errors);
    profile.joint_limits = merged(profile.joint_limits, options.joint_limits);
    for (const auto& entry : std::as_const(profile.fixed_joints).entries()) {
      profile.fixed_by_profile.insert(entry.key);
    }
    profile.fixed_joints = merged(profile.fixed_joints, options.fixed_joints);
    if (!options.package_paths.is_null()) profile.package_paths = options.package_paths;
    for (const Node* name : {&options.group, &options.held}) {
      if (!name->is_null()) SIDESTEP_TRY(name->as_string());
    }
    if (!options.group.is_null()) profile.group = options.group;
    profile.held = options.held;
  }
  if (!options.mount.is_null()) profile.mount = options.mount;
  if (!profile.urdf.empty()) {
    if (const auto model = read_model(profile, errors)) {
      auto robot = build_robot(*model, profile, errors);
      if (robot != nullptr && errors.empty()) {
        context.log.debug(counts_of(*model, profile, *robot));
        return robot;
      }
    }
  }
  return tl::make_unexpected(all_of(std::move(errors), what));
}

}  // namespace sidestep::urdf_robot
