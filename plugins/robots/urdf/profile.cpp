#include "load_robot.hpp"

#include <algorithm>
#include <utility>

namespace sidestep::urdf_robot {
namespace {

std::vector<std::string> known_profiles(const std::vector<std::filesystem::path>& robot_paths) {
  std::vector<std::string> names;
  for (const std::filesystem::path& path : robot_paths) {
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator(path, ignored)) {
      if (std::filesystem::is_regular_file(entry.path() / "profile.yaml", ignored))
        names.push_back(entry.path().filename().string());
    }
  }
  std::ranges::sort(names);
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

void check_base(const Profile& profile, const Node& document, std::vector<Error>& errors) {
  const Node* node = document.find("base");
  if (node == nullptr) return;
  const BaseOptions& base = profile.base;
  for (const Node::Entry& entry : node->entries()) {
    if (base.drives() || entry.key == "type") continue;
    const Node key(Node::Scalar{entry.key, false}, entry.key_mark);
    errors.push_back(key.error("'" + entry.key + "' says nothing of a base that is fixed",
                               "say 'type: holonomic', or 'differential'"));
  }
  if (base.joints.size() != 3)
    errors.push_back(node->error("'joints' needs three names: x, y and the heading"));
  if (base.lower_m.size() != 2 || base.upper_m.size() != 2) {
    errors.push_back(node->error("'lower_m' and 'upper_m' need two numbers each: x and y"));
  } else if (base.lower_m[0] > base.upper_m[0] || base.lower_m[1] > base.upper_m[1]) {
    errors.push_back(node->error("'lower_m' lies above 'upper_m'"));
  }
  check_braking(*node, "max_braking_mps2", "max_acceleration_mps2", errors);
  check_braking(*node, "max_turn_braking_radps2", "max_turn_acceleration_radps2", errors);
}

void check_tip(const Profile& profile, std::vector<Error>& errors) {
  const Node* node = profile.document.find("tip_link");
  if (node == nullptr || profile.tip_link.empty() || profile.joints.empty()) return;
  errors.push_back(node->error("'tip_link' chooses joints, and 'joints' lists them",
                               "leave one of the two out"));
}

/// Spheres come from one place.
void check_spheres(const Profile& profile, std::vector<Error>& errors) {
  const Node* node = profile.document.find("spheres_from");
  if (node == nullptr || profile.spheres.empty() || profile.spheres_from == "profile") return;
  errors.push_back(
      node->error("'spheres_from' is " + profile.spheres_from + ", and 'spheres' lists some",
                  "leave one of the two out"));
}

void check_shapes(const Profile& profile, std::vector<Error>& errors) {
  const Node* node = profile.document.find("shapes_from");
  if (node == nullptr || profile.shapes_from != "spheres") return;
  if (!profile.spheres.empty() || profile.spheres_from != "fit") return;
  errors.push_back(
      node->error("'shapes_from' is spheres and 'spheres_from' is fit: there are no "
                  "shapes that spheres could be fitted to",
                  "list the spheres under 'spheres'"));
}

}  // namespace

void check_braking(const Node& limits, std::string_view braking, std::string_view acceleration,
                   std::vector<Error>& errors) {
  const Node* node = limits.find(braking);
  if (node == nullptr || node->is_null()) return;
  const std::string name(braking), planned(acceleration);
  const Node* beside = limits.find(acceleration);
  if (beside == nullptr || beside->is_null()) {
    errors.push_back(node->error("'" + name + "' stands without '" + planned + "'",
                                 "say how hard motions may brake, too"));
    return;
  }
  const auto most = node->as_double(), of_motions = beside->as_double();
  const bool is_compared = most && of_motions && *most > 0.0;  // else it has been reported
  if (!is_compared || *most >= *of_motions) return;
  errors.push_back(node->error(
      "'" + name + "' is " + node->text() + ", below '" + planned + "', " + beside->text(),
      "stops brake at least as hard as motions"));
}

Parameters<BaseOptions> BaseOptions::parameters() {
  using T = BaseOptions;
  return Parameters<T>()
      .add("type", &T::type,
           "Whether the root link is fixed in the world or drives in its plane: any way, or on two "
           "driven wheels, ahead and back along its x axis, turning about its origin, which lies "
           "between them (`differential`).",
           {.choices = {"fixed", "holonomic", "differential"}})
      .add("joints", &T::joints, "Names of the base's joints: x, y, heading.")
      .add("lower_m", &T::lower_m, "Lowest x and y of the base in the world.", {.unit = "m"})
      .add("upper_m", &T::upper_m, "Highest x and y of the base in the world.", {.unit = "m"})
      .add("max_velocity_mps", &T::max_velocity_mps, "Largest speed along x and along y.",
           {.unit = "m/s", .min = 1e-6})
      .add("max_turn_rate_radps", &T::max_turn_rate_radps, "Largest rate of turn.",
           {.unit = "rad/s", .min = 1e-6})
      .add("max_acceleration_mps2", &T::max_acceleration_mps2,
           "Largest acceleration along x and along y; none if absent.",
           {.unit = "m/s^2", .min = 1e-6})
      .add("max_turn_acceleration_radps2", &T::max_turn_acceleration_radps2,
           "Largest acceleration of the heading; none if absent.", {.unit = "rad/s^2", .min = 1e-6})
      .add("max_braking_mps2", &T::max_braking_mps2,
           "Largest deceleration along x and along y where the robot is to stop; that of motions, "
           "'max_acceleration_mps2', if absent.",
           {.unit = "m/s^2", .min = 1e-6})
      .add("max_turn_braking_radps2", &T::max_turn_braking_radps2,
           "The same of the heading; 'max_turn_acceleration_radps2' if absent.",
           {.unit = "rad/s^2", .min = 1e-6});
}

Parameters<MountOptions> MountOptions::parameters() {
  using T = MountOptions;
  return Parameters<T>()
      .add("position_m", &T::position_m, "Of the root link's origin, world frame.", {.unit = "m"})
      .add("rpy_rad", &T::rpy_rad, "Its roll, pitch and yaw about the world's axes.",
           {.unit = "rad"});
}

Parameters<JointLimitOptions> JointLimitOptions::parameters() {
  using T = JointLimitOptions;
  return Parameters<T>()
      .add("lower", &T::lower, "Lowest position, in m or rad; the URDF's if absent.")
      .add("upper", &T::upper, "Highest position, in m or rad; the URDF's if absent.")
      .add("max_velocity", &T::max_velocity, "In m/s or rad/s; the URDF's if absent.",
           {.min = 1e-6})
      .add("max_acceleration", &T::max_acceleration, "In m/s^2 or rad/s^2; none if absent.",
           {.min = 1e-6})
      .add(
          "max_braking", &T::max_braking,
          "The deceleration where the robot is to stop, in m/s^2 or rad/s^2; 'max_acceleration' if "
          "absent.",
          {.min = 1e-6});
}

Parameters<CoupledJointOptions> CoupledJointOptions::parameters() {
  using T = CoupledJointOptions;
  return Parameters<T>()
      .add("joint", &T::joint, "The joint that it follows.", {.required = true})
      .add("multiplier", &T::multiplier, "Of that joint's position.")
      .add("offset", &T::offset, "Added to it, in m or rad.");
}

Parameters<SphereOptions> SphereOptions::parameters() {
  using T = SphereOptions;
  return Parameters<T>()
      .add("link", &T::link, "The link that carries the sphere.", {.required = true})
      .add("centre_m", &T::centre_m, "Its centre in the link's frame.",
           {.unit = "m", .required = true})
      .add("radius_m", &T::radius_m, "Its radius.", {.unit = "m", .min = 1e-6, .required = true});
}

Parameters<HeadOptions> HeadOptions::parameters() {
  using T = HeadOptions;
  return Parameters<T>()
      .add("pan_joint", &T::pan_joint, "The joint that turns it; not one that is planned.",
           {.required = true})
      .add("tilt_joint", &T::tilt_joint, "The joint that nods it; carried by 'pan_joint'.",
           {.required = true})
      .add("camera_link", &T::camera_link,
           "The link whose frame is the camera's optical one (z forward, y down); carried by "
           "'tilt_joint'.",
           {.required = true});
}

Parameters<SelfCollisionOptions> SelfCollisionOptions::parameters() {
  return Parameters<SelfCollisionOptions>().add(
      "pairs", &SelfCollisionOptions::pairs,
      "Pairs of links that are checked against each other, "
      "as `sidestep_self_collision` finds them.",
      {.required = true});
}

Parameters<Profile> Profile::parameters() {
  using T = Profile;
  return Parameters<T>()
      .add("name", &T::name, "The robot's name.", {.required = true})
      .add("urdf", &T::urdf, "The robot's URDF, relative to the profile.", {.required = true})
      .add("root_link", &T::root_link, "Takes only the part of the URDF from this link on.")
      .add("tip_link", &T::tip_link,
           "Without 'joints': plans the joints between the root and this link.")
      .add("joints", &T::joints,
           "The planned joints in the order of q, after the base's; all that move if empty.")
      .add("groups", &T::groups,
           "A map from names to lists of planned joints, of which a configuration's `group` plans "
           "one. A group with the base's joints has all three.")
      .add("group", &T::group,
           "The group that is planned where a configuration names none; all joints if absent.")
      .add("base", &T::base, "How the root link moves in the world.")
      .add("mount", &T::mount,
           "Where the root link is of a robot without a base that drives: {position_m, rpy_rad}, "
           "world frame; the origin if absent.")
      .add("joint_limits", &T::joint_limits,
           "A map from joints to what replaces the URDF's limits: lower, upper, max_velocity, "
           "max_acceleration, max_braking.")
      .add("fixed_joints", &T::fixed_joints,
           "A map from moving joints that are not planned to where they stay; 0 if absent.")
      .add(
          "coupled_joints", &T::coupled_joints,
          "A map from joints to {joint, multiplier, offset}: each follows another, as <mimic> says "
          "where the URDF has it. A telescope's stages, say.")
      .add("head", &T::head,
           "The head that turns a camera: two joints that are not planned. Where it rests, "
           "'fixed_joints' says, how fast it turns, the URDF and 'joint_limits'.")
      .add("spheres", &T::spheres, "The collision spheres.")
      .add("spheres_from", &T::spheres_from,
           "Where the spheres come from: this profile, the URDF's <sphere>s, or a fit to the "
           "URDF's shapes.",
           {.choices = {"profile", "urdf", "fit"}})
      .add("sphere_protrusion_m", &T::sphere_protrusion_m,
           "How far fitted spheres may stand out from the shapes.",
           {.unit = "m", .min = 0.001, .max = 1.0})
      .add("shapes_from", &T::shapes_from,
           "What the independent check takes for the robot: the URDF's collision shapes, or the "
           "spheres, where these are the whole truth. The URDF's own are then not used.",
           {.choices = {"urdf", "spheres"}})
      .add("self_collision", &T::self_collision,
           "What is checked against itself; without it all links but neighbours and those that "
           "touch at the default configuration.")
      .add("poses", &T::poses,
           "A map from names to configurations: a map from joints to positions, or a list of all.")
      .add("package_paths", &T::package_paths,
           "Folders in which package://NAME/... is looked for as NAME/...");
}

const Node* Profile::item(std::string_view key, std::size_t index) const noexcept {
  const Node* list = document.find(key);
  if (list == nullptr || index >= list->items().size()) return list;
  return &list->items()[index];
}

Result<std::filesystem::path> find_profile(const Node& profile,
                                           const std::vector<std::filesystem::path>& robot_paths) {
  const auto text = SIDESTEP_TRY(profile.as_string());
  std::error_code ignored;
  const auto usable = [&](const std::filesystem::path& file) {
    return std::filesystem::is_regular_file(file, ignored);
  };
  const bool is_name = text.find('/') == std::string::npos && !text.ends_with(".yaml");
  std::string tried;
  if (is_name) {
    for (const std::filesystem::path& path : robot_paths) {
      const std::filesystem::path file = path / text / "profile.yaml";
      if (usable(file)) return file;
      tried += (tried.empty() ? "" : ", ") + file.string();
    }
  }
  const auto path = SIDESTEP_TRY(profile.as_path());
  if (usable(path)) return path;
  if (usable(path / "profile.yaml")) return path / "profile.yaml";
  tried += (tried.empty() ? "" : ", ") + path.string();

  const std::vector<std::string> names = known_profiles(robot_paths);
  const std::string nearest = nearest_name(text, names);
  std::string hint = nearest.empty() ? "" : "did you mean '" + nearest + "'? ";
  if (!names.empty()) hint += "there are: " + joined(names) + "; ";
  return fail(ErrorCode::kNotFound, "there is no robot profile '" + text + "'",
              profile.mark().to_string(), hint + "tried " + tried);
}

Profile read_profile(const std::filesystem::path& file, const DocumentReader& documents,
                     std::vector<Error>& errors) {
  Profile profile;
  auto document = documents.read_leniently(file, errors);
  if (!document) {
    errors.push_back(std::move(document.error()));
    return profile;
  }
  if (!document->is_map()) {
    errors.push_back(document->error("a robot profile is a map, found " + document->kind()));
    return profile;
  }
  profile.document = std::move(*document);
  const std::size_t before = errors.size();
  const Parameters<Profile> fields = Profile::parameters();
  check_against_schema(profile.document, fields.schema(), {}, errors);
  std::vector<Error> seen_already;
  fields.read(profile.document, profile, errors.size() == before ? errors : seen_already);
  check_base(profile, profile.document, errors);
  check_tip(profile, errors);
  check_spheres(profile, errors);
  check_shapes(profile, errors);
  return profile;
}

}  // namespace sidestep::urdf_robot
