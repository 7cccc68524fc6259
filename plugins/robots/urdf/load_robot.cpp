#include "load_robot.hpp"

#include "build_robot.hpp"
#include "profile.hpp"
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

std::optional<UrdfModel> read_model(const Profile& profile, std::vector<Error>& errors) {
  auto model = read_urdf(profile.urdf, errors);
  if (!model || profile.root_link.empty()) return model;
  if (const auto root = model->link_index(profile.root_link)) return subtree(*model, *root);
  errors.push_back({ErrorCode::kConfig, "the URDF has no link '" + profile.root_link + "'",
                    profile.urdf.string(), did_you_mean(profile.root_link, model->link_names()),
                    nullptr});
  return {};
}

}  // namespace

Parameters<Options> Options::parameters() {
  using T = Options;
  return Parameters<T>()
      .add("profile", &T::profile,
           "The robot's profile: its name, its folder, or its file. Either this or 'urdf'.")
      .add("urdf", &T::urdf, "A URDF to be used as it is, its collision shapes covered by spheres.")
      .add("base", &T::base, "With 'urdf': whether the root link is fixed or drives in its plane.",
           {.choices = {"fixed", "holonomic"}})
      .add("root_link", &T::root_link, "With 'urdf': takes only the part from this link on.")
      .add("tip_link", &T::tip_link,
           "With 'urdf', without 'joints': plans the joints between the root and this link.")
      .add("joints", &T::joints,
           "With 'urdf': the planned joints in the order of q; all that move if empty.")
      .add("joint_limits", &T::joint_limits,
           "A map from joints to {lower, upper, max_velocity, max_acceleration}; replaces what the "
           "profile or the URDF says.")
      .add("fixed_joints", &T::fixed_joints,
           "A map from joints that are not planned to where they stay, in m or rad; over the "
           "profile's.")
      .add("package_paths", &T::package_paths,
           "Folders in which package://NAME/... is looked for as NAME/....")
      .add("sphere_protrusion_m", &T::sphere_protrusion_m,
           "With 'urdf': how far the spheres may stand out from the shapes.",
           {.unit = "m", .min = 0.001, .max = 1.0});
}

std::vector<OptionMistake> Options::check() const {
  if (profile.is_null()) {
    if (!urdf.empty()) return {};
    return {{{}, "the robot needs either 'profile' or 'urdf'", {}}};
  }
  std::vector<OptionMistake> mistakes;
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
    profile.fixed_joints = merged(profile.fixed_joints, options.fixed_joints);
    if (!options.package_paths.is_null()) profile.package_paths = options.package_paths;
  }
  if (!profile.urdf.empty()) {
    if (const auto model = read_model(profile, errors)) {
      auto robot = build_robot(*model, profile, errors);
      if (robot != nullptr && errors.empty()) return robot;
    }
  }
  return tl::make_unexpected(all_of(std::move(errors), what));
}

}  // namespace sidestep::urdf_robot
