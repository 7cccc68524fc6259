#include "build_robot.hpp"

#include <algorithm>
#include <set>

#include <sidestep/core/index.hpp>
#include <sidestep/robot/sphere_fit.hpp>

#include "joint_table.hpp"

namespace sidestep::urdf_robot {

std::vector<PackagePath> package_paths_of(const std::vector<std::string>& texts) {
  std::vector<PackagePath> paths;
  for (const std::string& text : texts) {
    const auto equals = text.find('=');
    if (equals == std::string::npos) {
      paths.push_back({{}, text});
    } else {
      paths.push_back({text.substr(0, equals), text.substr(equals + 1)});
    }
  }
  return paths;
}

std::vector<std::filesystem::path> MeshFinder::candidates(const std::string& uri) const {
  const auto scheme_end = uri.find("://");
  if (scheme_end == std::string::npos) return {urdf_.parent_path() / uri};
  const std::string scheme = uri.substr(0, scheme_end);
  const std::filesystem::path rest = uri.substr(scheme_end + 3);
  if (scheme == "file") return {rest};
  if (scheme != "package" && scheme != "model") return {};

  const std::filesystem::path package = rest.empty() ? rest : *rest.begin();
  const std::filesystem::path inside = rest.lexically_relative(package);
  std::vector<std::filesystem::path> files;
  const auto add = [&](const std::filesystem::path& folder) {
    files.push_back(folder / rest);
    if (folder.filename() == package) files.push_back(folder / inside);
  };
  for (const PackagePath& path : package_paths_) {
    if (path.name.empty()) add(path.folder);
    if (path.name == package) files.push_back(path.folder / inside);
  }
  std::error_code ignored;
  std::filesystem::path above = std::filesystem::absolute(urdf_, ignored).lexically_normal();
  while (above.has_relative_path()) {
    above = above.parent_path();
    add(above);
  }
  return files;
}

Result<std::shared_ptr<const Mesh>> MeshFinder::load(const std::string& uri,
                                                     const Eigen::Vector3d& scale,
                                                     const SourceMark& mark) const {
  const std::vector<std::filesystem::path> files = candidates(uri);
  std::error_code ignored;
  const auto found = std::ranges::find_if(files, [&](const std::filesystem::path& file) {
    return std::filesystem::is_regular_file(file, ignored);
  });
  if (found == files.end()) {
    std::string tried;
    for (const auto& file : files) tried += (tried.empty() ? "tried " : ", ") + file.string();
    return fail(ErrorCode::kNotFound, "the mesh '" + uri + "' is not there", mark.to_string(),
                "name the folder of its package, by 'package_paths' or --package-path; " + tried);
  }
  auto mesh = SIDESTEP_TRY(read_mesh(found->string()));
  for (Eigen::Vector3d& vertex : mesh.vertices_m) vertex = vertex.cwiseProduct(scale);
  // A mirroring scale turns the triangles inside out.
  if (scale.prod() < 0.0) {
    for (Eigen::Vector3i& triangle : mesh.triangles) std::swap(triangle.y(), triangle.z());
  }
  return indexed_mesh(std::move(mesh));
}

namespace {

constexpr const char* kBaseRoot = "world";  // a URDF's root link hangs on "root" where it stands
constexpr std::size_t kBaseJoints = 3;
constexpr double kHeld = 1e-6;  ///< m or rad: as good as where a joint is held.

/// Builds the description part by part; what is wrong goes to errors.
class RobotBuilder {
 public:
  RobotBuilder(const UrdfModel& model, const Profile& profile, std::vector<Error>& errors)
      : model_(model), profile_(profile), errors_(errors) {}

  std::unique_ptr<KinematicTree> run() {
    JointTable joints(model_, profile_, errors_);
    robot_.name = profile_.name.empty() ? model_.name : profile_.name;
    robot_.joints = joints.planned();
    add_links(joints);
    add_shapes();
    add_spheres();
    add_poses(joints);
    if (profile_.head) add_head(*profile_.head, joints);
    if (profile_.self_collision.pairs.is_null()) {
      if (errors_.empty()) guess_pairs();
    } else {
      add_pairs();
    }
    if (!errors_.empty()) return nullptr;
    auto tree = KinematicTree::create(std::move(robot_), std::move(tree_joints_));
    if (tree) return std::move(*tree);
    errors_.push_back(tree.error().wrapped(ErrorCode::kConfig, "the robot does not fit together",
                                           model_.file.string()));
    return nullptr;
  }

 private:
  /// A link's name that the URDF does not have.
  std::string free_name(std::string name) const {
    while (model_.link_index(name)) name += "_";
    return name;
  }

  void add_base_links(const JointTable& joints) {
    const auto add = [&](const std::string& name, TreeJoint joint) {
      robot_.links.push_back({free_name(name), static_cast<int>(robot_.links.size()) - 1});
      tree_joints_.push_back(std::move(joint));
    };
    add(kBaseRoot, TreeJoint{kBaseRoot});
    for (int i = 0; i < 2; ++i) {
      TreeJoint joint = joints.base_joint(idx(i));
      joint.axis = Eigen::Vector3d::Unit(i);
      add(i == 0 ? "base_x" : "base_y", joint);
    }
  }

  void add_links(const JointTable& joints) {
    const bool has_base = joints.has_base();
    if (has_base && !profile_.mount.is_null()) {
      errors_.push_back(profile_.mount.error("a robot with a base that drives has no 'mount'",
                                             "plan a `group` without its base's joints, and say "
                                             "where these are in 'fixed_joints'"));
    }
    if (has_base) add_base_links(joints);
    robot_.rolling = joints.rolling();
    first_link_ = static_cast<int>(robot_.links.size());
    for (const UrdfLink& link : model_.links) {
      robot_.links.push_back(
          {link.name, link.parent == -1 ? first_link_ - 1 : first_link_ + link.parent});
      if (link.joint) {
        tree_joints_.push_back(joints.tree_joint(*link.joint));
        continue;
      }
      TreeJoint root{"root"};
      if (has_base) {
        root = joints.base_joint(2);
      } else {
        root.T_parent_joint = mount();
      }
      tree_joints_.push_back(std::move(root));
    }
  }

  /// Where the root link is that does not drive.
  [[nodiscard]] Transform mount() const {
    MountOptions mount;
    if (profile_.mount.is_null()) return Transform::Identity();
    const auto fields = MountOptions::parameters();
    const std::size_t before = errors_.size();
    check_against_schema(profile_.mount, fields.schema(), {}, errors_);
    if (errors_.size() == before) fields.read(profile_.mount, mount, errors_);
    return transform_from_xyz_rpy(mount.position_m, mount.rpy_rad);
  }

  [[nodiscard]] bool spheres_are_shapes() const { return profile_.shapes_from == "spheres"; }

  void add_shapes() {
    const MeshFinder meshes(model_.file, package_paths());
    if (spheres_are_shapes()) return;
    bool is_empty = true;
    for (std::size_t i = 0; i < model_.links.size(); ++i) {
      for (const UrdfShape& entry : model_.links[i].shapes) {
        is_empty = false;
        CollisionShape shape{first_link_ + static_cast<int>(i), entry.shape, entry.T_link_shape};
        if (!entry.mesh_uri.empty()) {
          auto mesh = meshes.load(entry.mesh_uri, entry.mesh_scale, entry.mark);
          if (!mesh) {
            mesh.error().message = "link '" + model_.links[i].name + "': " + mesh.error().message;
            errors_.push_back(std::move(mesh.error()));
            continue;
          }
          shape.shape = std::move(*mesh);
        }
        robot_.shapes.push_back(std::move(shape));
        marks_.push_back(entry.mark);
      }
    }
    if (!is_empty) return;
    errors_.push_back({ErrorCode::kConfig, "no link of the URDF has a <collision>",
                       model_.file.string(),
                       "give its links some, or, in a profile whose spheres are all that there is "
                       "to collide with, set 'shapes_from' to spheres"});
  }

  std::vector<PackagePath> package_paths() {
    std::vector<PackagePath> paths;
    const Node& node = profile_.package_paths;
    if (!node.is_list() && !node.is_null())
      errors_.push_back(node.error(
          "'package_paths' is a list of folders and of {NAME: FOLDER}, found " + node.kind()));
    const auto add = [&](const std::string& name, const Node& folder) {
      auto path = folder.as_path();
      if (path) {
        paths.push_back({name, std::move(*path)});
      } else {
        errors_.push_back(std::move(path.error()));
      }
    };
    for (const Node& item : node.items()) {
      if (!item.is_map()) add({}, item);
      for (const Node::Entry& entry : item.entries()) add(entry.key, entry.value);
    }
    return paths;
  }

  void add_spheres() {
    if (!profile_.spheres.empty()) {
      add_listed_spheres();
    } else if (profile_.spheres_from == "fit") {
      fit_to_shapes();
    } else {
      add_spheres_of_urdf();
    }
    if (spheres_are_shapes()) {
      for (const CollisionSphere& sphere : robot_.spheres) {
        robot_.shapes.push_back({sphere.link, Sphere{sphere.radius_m},
                                 Transform(Eigen::Translation3d(sphere.centre_link_m))});
      }
    }
    if (!robot_.spheres.empty() || !errors_.empty()) return;
    const Node* list = profile_.document.find("spheres");
    const std::string where =
        list != nullptr ? list->mark().to_string()
                        : (profile_.document.is_null() ? model_.file.string()
                                                       : profile_.document.mark().to_string());
    errors_.push_back({ErrorCode::kConfig, "the robot has no collision spheres", where,
                       "list them under 'spheres', or set 'spheres_from' to urdf or fit"});
  }

  void add_listed_spheres() {
    for (std::size_t i = 0; i < profile_.spheres.size(); ++i) {
      const SphereOptions& sphere = profile_.spheres[i];
      const Node* item = profile_.item("spheres", i);
      const Node* name = item == nullptr ? nullptr : item->find("link");
      const auto link = name == nullptr ? std::nullopt : find_link(sphere.link, *name);
      if (link) robot_.spheres.push_back({*link, sphere.centre_m, sphere.radius_m});
    }
  }

  void add_spheres_of_urdf() {
    for (std::size_t i = 0; i < model_.links.size(); ++i) {
      for (const UrdfShape& entry : model_.links[i].shapes) {
        const auto* sphere = std::get_if<Sphere>(&entry.shape);
        if (sphere == nullptr) continue;
        robot_.spheres.push_back({first_link_ + static_cast<int>(i),
                                  entry.T_link_shape.translation(), sphere->radius_m});
      }
    }
  }

  void fit_to_shapes() {
    for (std::size_t i = 0; i < robot_.shapes.size(); ++i) {
      const CollisionShape& shape = robot_.shapes[i];
      const auto spheres = fit_spheres(shape, profile_.sphere_protrusion_m);
      if (spheres) {
        robot_.spheres.insert(robot_.spheres.end(), spheres->begin(), spheres->end());
        continue;
      }
      errors_.push_back(spheres.error());
      Error& error = errors_.back();
      error.code = ErrorCode::kConfig;
      error.message = "link '" + robot_.links[idx(shape.link)].name + "': " + error.message;
      error.where = marks_[i].to_string();
    }
  }

  /// A link by name; reports an unknown one.
  std::optional<int> find_link(const std::string& name, const Node& where) {
    if (const auto link = robot_.link_index(name)) return link;
    std::vector<std::string> names;
    for (const Link& link : robot_.links) names.push_back(link.name);
    errors_.push_back(
        where.error("the URDF has no link '" + name + "'", did_you_mean(name, names)));
    return {};
  }

  void add_pairs() {
    const Node& pairs = profile_.self_collision.pairs;
    if (!pairs.is_list()) {
      errors_.push_back(pairs.error("'pairs' is a list of pairs of links, found " + pairs.kind()));
    }
    std::set<std::pair<int, int>> seen;
    for (const Node& item : pairs.items()) {
      if (item.items().size() != 2) {
        errors_.push_back(item.error("expected the names of two links"));
        continue;
      }
      const auto a = find_link(item.items()[0].text(), item.items()[0]);
      const auto b = find_link(item.items()[1].text(), item.items()[1]);
      if (!a || !b) continue;
      if (*a == *b) {
        errors_.push_back(item.error("a link cannot be checked against itself"));
      } else if (!seen.insert(std::minmax(*a, *b)).second) {
        errors_.push_back(item.error("the pair is listed twice"));
      }
    }
    robot_.self_collision_pairs.assign(seen.begin(), seen.end());
  }

  /// Without a list: links with spheres that no single joint connects and that do not touch at
  /// the default configuration.
  void guess_pairs() {
    std::vector<double> q;
    for (const Joint& joint : robot_.joints) {
      q.push_back(std::clamp(0.0, joint.lower, joint.upper));
    }
    const auto tree = KinematicTree::create(robot_, tree_joints_);
    if (!tree) return;  // run() reports it
    std::vector<Eigen::Vector3d> centres(robot_.spheres.size());
    Scratch scratch;
    (*tree)->sphere_centres(q, centres, scratch);
    std::set<std::pair<int, int>> apart;
    std::set<std::pair<int, int>> touching;
    for (std::size_t s = 0; s < centres.size(); ++s) {
      for (std::size_t t = s + 1; t < centres.size(); ++t) {
        const auto pair = std::minmax(robot_.spheres[s].link, robot_.spheres[t].link);
        if (!are_two_joints_between(pair.first, pair.second)) continue;
        const double reach = robot_.spheres[s].radius_m + robot_.spheres[t].radius_m;
        ((centres[s] - centres[t]).norm() < reach ? touching : apart).insert(pair);
      }
    }
    for (const auto& pair : apart) {
      if (!touching.contains(pair)) robot_.self_collision_pairs.push_back(pair);
    }
  }

  /// Whether two joints or more move the links against each other.
  bool are_two_joints_between(int a, int b) const {
    int count = 0;
    while (a != b && count < 2) {
      int& lower = a > b ? a : b;  // parents come first, so the higher index is no ancestor
      if (tree_joints_[idx(lower)].joint != -1) ++count;
      lower = robot_.links[idx(lower)].parent;
    }
    return count == 2;
  }

  void add_head(const HeadOptions& options, JointTable& joints) {
    const Node& block = *profile_.document.find("head");
    const Node* pan = block.find("pan_joint");
    const Node* tilt = block.find("tilt_joint");
    const Node* camera_link = block.find("camera_link");
    if (pan == nullptr || tilt == nullptr || camera_link == nullptr) return;  // has been told
    const auto axis = [&](const std::string& name, const Node& where) {
      HeadDescription::Axis made;
      if (auto joint = joints.head_joint(name, where)) made.joint = std::move(*joint);
      const auto link = std::ranges::find(tree_joints_, name, &TreeJoint::name);
      made.link = static_cast<int>(link - tree_joints_.begin());
      return made;
    };
    const auto camera = find_link(options.camera_link, *camera_link);
    HeadDescription head{axis(options.pan_joint, *pan), axis(options.tilt_joint, *tilt),
                         camera.value_or(0)};
    if (!errors_.empty()) return;
    if (carries(head.pan.link, robot_.links[idx(head.tilt.link)].parent) &&
        carries(head.tilt.link, head.camera_link)) {
      robot_.head = std::move(head);
      return;
    }
    errors_.push_back(block.error("'" + options.pan_joint + "' does not carry '" +
                                  options.tilt_joint + "', or that not '" + options.camera_link +
                                  "', by fixed joints alone"));
  }

  /// Whether a link is another one, or rigidly attached to it.
  [[nodiscard]] bool carries(int link, int carried) const {
    while (carried > link && tree_joints_[idx(carried)].motion == TreeJoint::Motion::kFixed) {
      carried = robot_.links[idx(carried)].parent;
    }
    return carried == link;
  }

  /// Those in which what is held is where it is.
  void add_poses(const JointTable& joints) {
    const Node& poses = profile_.poses;
    if (!poses.is_map() && !poses.is_null())
      errors_.push_back(poses.error("'poses' is a map from names to poses, found " + poses.kind()));
    for (const Node::Entry& entry : poses.entries()) {
      NamedPose pose{entry.key, std::vector<std::optional<double>>(robot_.joints.size())};
      is_held_elsewhere_ = false;
      if (entry.value.is_list()) {
        read_pose_list(entry.value, joints, pose);
      } else if (entry.value.is_map()) {
        read_pose_map(entry.value, joints, pose);
      } else {
        errors_.push_back(entry.value.error(
            "a pose is a map from joints to positions or a list, found " + entry.value.kind()));
      }
      if (is_held_elsewhere_) continue;
      robot_.poses.push_back(std::move(pose));
    }
  }

  void read_pose_list(const Node& list, const JointTable& table, NamedPose& pose) {
    const std::vector<Joint>& joints = table.of_profile();
    if (list.items().size() != joints.size()) {
      errors_.push_back(list.error("pose '" + pose.name + "' has " +
                                   std::to_string(list.items().size()) + " positions for " +
                                   std::to_string(joints.size()) + " planned joints"));
      return;
    }
    for (std::size_t j = 0; j < joints.size(); ++j) {
      set_position(list.items()[j], joints[j], table, pose);
    }
  }

  void read_pose_map(const Node& map, const JointTable& table, NamedPose& pose) {
    const std::vector<Joint>& joints = table.of_profile();
    for (const Node::Entry& entry : map.entries()) {
      const auto joint = std::ranges::find(joints, entry.key, &Joint::name);
      if (joint != joints.end()) {
        set_position(entry.value, *joint, table, pose);
        continue;
      }
      std::vector<std::string> names;
      for (const Joint& one : joints) names.push_back(one.name);
      const Node key(Node::Scalar{entry.key, false}, entry.key_mark);
      errors_.push_back(
          key.error("pose '" + pose.name + "' names '" + entry.key + "', which is no planned joint",
                    did_you_mean(entry.key, names)));
    }
  }

  void set_position(const Node& node, const Joint& joint, const JointTable& table,
                    NamedPose& pose) {
    const auto value = node.as_double();
    if (!value) {
      errors_.push_back(value.error());
      return;
    }
    if (*value < joint.lower || *value > joint.upper) {
      errors_.push_back(node.error("pose '" + pose.name + "' has joint '" + joint.name +
                                   "' outside of its limits, " + detail::number_text(joint.lower) +
                                   " to " + detail::number_text(joint.upper)));
      return;
    }
    if (const auto index = robot_.joint_index(joint.name)) {
      pose.positions[idx(*index)] = *value;
    } else {
      is_held_elsewhere_ |= std::abs(table.held_at(joint.name) - *value) > kHeld;
    }
  }

  const UrdfModel& model_;
  const Profile& profile_;
  std::vector<Error>& errors_;
  RobotDescription robot_;
  std::vector<TreeJoint> tree_joints_;
  std::vector<SourceMark> marks_;   // of the shapes
  int first_link_ = 0;              // of the URDF's own
  bool is_held_elsewhere_ = false;  // the pose being read has a joint that is held, otherwise
};

}  // namespace

std::unique_ptr<KinematicTree> build_robot(const UrdfModel& model, const Profile& profile,
                                           std::vector<Error>& errors) {
  return RobotBuilder(model, profile, errors).run();
}

std::size_t base_joints(const KinematicTree& robot) noexcept {
  return robot.tree_joints().front().name == kBaseRoot ? kBaseJoints : 0;
}

}  // namespace sidestep::urdf_robot
