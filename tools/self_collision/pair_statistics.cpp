#include "pair_statistics.hpp"

#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/collision_object.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <sstream>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

struct Padded {
  double padding_m;
  using Geometry = std::shared_ptr<fcl::CollisionGeometryd>;

  Geometry operator()(const Box& box) const {
    const Eigen::Vector3d size = box.size_m.array() + 2.0 * padding_m;
    return std::make_shared<fcl::Boxd>(size);
  }
  Geometry operator()(const Sphere& sphere) const {
    return std::make_shared<fcl::Sphered>(sphere.radius_m + padding_m);
  }
  Geometry operator()(const Cylinder& cylinder) const {
    return std::make_shared<fcl::Cylinderd>(cylinder.radius_m + padding_m,
                                            cylinder.length_m + 2.0 * padding_m);
  }
  Geometry operator()(const Capsule& capsule) const {
    return std::make_shared<fcl::Capsuled>(capsule.radius_m + padding_m, capsule.length_m);
  }
  Geometry operator()(const HalfSpace&) const { return nullptr; }
  Geometry operator()(const std::shared_ptr<const Mesh>& mesh) const {
    auto model = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
    model->beginModel();
    for (const Eigen::Vector3i& triangle : mesh->triangles) {
      const auto vertex = [&](int i) { return mesh->vertices_m[idx(triangle[i])]; };
      model->addTriangle(vertex(0), vertex(1), vertex(2));
    }
    model->endModel();
    return model;
  }
};

/// The robot's shapes as FCL sees them, moved from one configuration to the next.
class Bodies {
 public:
  Bodies(const KinematicTree& tree, double padding_m)
      : tree_(tree),
        T_world_link_(tree.description().links.size()),
        parts_(tree.description().links.size()) {
    for (const CollisionShape& shape : tree.description().shapes)
      add(shape.link, std::visit(Padded{padding_m}, shape.shape), shape.T_link_shape);
    std::vector<bool> shaped(parts_.size());
    for (std::size_t i = 0; i < parts_.size(); ++i) shaped[i] = !parts_[i].empty();
    for (const CollisionSphere& sphere : tree.description().spheres) {
      if (shaped[idx(sphere.link)]) continue;
      Transform T_link_sphere = Transform::Identity();
      T_link_sphere.translate(sphere.centre_link_m);
      add(sphere.link, Padded{padding_m}(Sphere{sphere.radius_m}), T_link_sphere);
    }
  }

  [[nodiscard]] bool solid(int link) const { return !parts_[idx(link)].empty(); }

  void move_to(std::span<const double> q) {
    tree_.link_poses(q, T_world_link_, scratch_);
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      for (Part& part : parts_[i]) {
        part.object->setTransform(T_world_link_[i] * part.T_link_shape);
        part.object->computeAABB();
      }
    }
  }

  [[nodiscard]] bool touch(int a, int b) const {
    for (const Part& first : parts_[idx(a)]) {
      for (const Part& second : parts_[idx(b)]) {
        if (!first.object->getAABB().overlap(second.object->getAABB())) continue;
        fcl::CollisionResultd result;
        if (fcl::collide(first.object.get(), second.object.get(), fcl::CollisionRequestd(),
                         result) > 0)
          return true;
      }
    }
    return false;
  }

 private:
  struct Part {
    std::unique_ptr<fcl::CollisionObjectd> object;
    Transform T_link_shape;
  };

  void add(int link, const std::shared_ptr<fcl::CollisionGeometryd>& geometry,
           const Transform& T_link_shape) {
    if (geometry == nullptr) return;
    Part& part = parts_[idx(link)].emplace_back();
    part.object = std::make_unique<fcl::CollisionObjectd>(geometry);
    part.T_link_shape = T_link_shape;
  }

  const KinematicTree& tree_;
  std::vector<Transform> T_world_link_;
  std::vector<std::vector<Part>> parts_;  // per link
  Scratch scratch_;
};

int planned_joints_between(const KinematicTree& tree, int a, int b) {
  int count = 0;
  while (a != b) {
    int& lower = a > b ? a : b;  // parents come first, so the higher index is no ancestor
    if (tree.tree_joints()[idx(lower)].joint != -1) ++count;
    lower = tree.description().links[idx(lower)].parent;
  }
  return count;
}

std::vector<std::vector<int>> spheres_on_links(const RobotDescription& robot) {
  std::vector<std::vector<int>> on_link(robot.links.size());
  for (std::size_t s = 0; s < robot.spheres.size(); ++s)
    on_link[idx(robot.spheres[s].link)].push_back(static_cast<int>(s));
  return on_link;
}

bool spheres_touch(const RobotDescription& robot, const std::vector<std::vector<int>>& on_link,
                   const std::vector<Eigen::Vector3d>& centres, int a, int b) {
  for (const int s : on_link[idx(a)]) {
    for (const int t : on_link[idx(b)]) {
      const double reach = robot.spheres[idx(s)].radius_m + robot.spheres[idx(t)].radius_m;
      if ((centres[idx(s)] - centres[idx(t)]).squaredNorm() < reach * reach) return true;
    }
  }
  return false;
}

std::vector<double> random_configuration(const RobotDescription& robot,
                                         std::mt19937_64& generator) {
  std::vector<double> q;
  for (const Joint& joint : robot.joints) {
    const double lower = std::isfinite(joint.lower) ? joint.lower : -M_PI;
    const double upper = std::isfinite(joint.upper) ? joint.upper : M_PI;
    q.push_back(std::uniform_real_distribution<double>(lower, upper)(generator));
  }
  return q;
}

std::vector<PairStatistics> movable_pairs(const KinematicTree& tree, const Bodies& bodies) {
  std::vector<PairStatistics> pairs;
  const int links = static_cast<int>(tree.description().links.size());
  for (int a = 0; a < links; ++a) {
    for (int b = a + 1; b < links; ++b) {
      if (!bodies.solid(a) || !bodies.solid(b)) continue;
      const int between = planned_joints_between(tree, a, b);
      if (between == 0) continue;
      PairStatistics pair{a, b};
      if (between == 1) pair.verdict = PairStatistics::Verdict::kAdjacent;
      pairs.push_back(pair);
    }
  }
  return pairs;
}

}  // namespace

std::vector<PairStatistics> sample_pairs(const KinematicTree& tree, const SamplingOptions& options,
                                         const std::function<bool(int sample)>& goes_on) {
  const RobotDescription& robot = tree.description();
  Bodies bodies(tree, 0.5 * options.margin_m);
  std::vector<PairStatistics> pairs = movable_pairs(tree, bodies);
  const auto on_link = spheres_on_links(robot);

  std::mt19937_64 generator(options.seed);
  std::vector<Eigen::Vector3d> centres(robot.spheres.size());
  Scratch scratch;
  for (int i = 0; i < options.samples; ++i) {
    if (goes_on && !goes_on(i)) break;
    const std::vector<double> q = random_configuration(robot, generator);
    bodies.move_to(q);
    tree.sphere_centres(q, centres, scratch);
    for (PairStatistics& pair : pairs) {
      if (bodies.touch(pair.a, pair.b)) ++pair.shapes_touch;
      if (spheres_touch(robot, on_link, centres, pair.a, pair.b)) ++pair.spheres_touch;
    }
  }
  for (PairStatistics& pair : pairs) {
    if (pair.verdict == PairStatistics::Verdict::kAdjacent) continue;
    if (pair.shapes_touch == 0) {
      pair.verdict = PairStatistics::Verdict::kNever;
    } else if (pair.shapes_touch >= options.always_share * options.samples) {
      pair.verdict = PairStatistics::Verdict::kAlways;
    }
  }
  return pairs;
}

std::vector<std::pair<int, int>> touching_pairs(const KinematicTree& tree,
                                                std::span<const double> q) {
  Bodies bodies(tree, 0.0);
  bodies.move_to(q);
  std::vector<std::pair<int, int>> touching;
  for (const PairStatistics& pair : movable_pairs(tree, bodies)) {
    if (bodies.touch(pair.a, pair.b)) touching.emplace_back(pair.a, pair.b);
  }
  return touching;
}

std::vector<std::pair<int, int>> touching_spheres(const KinematicTree& tree,
                                                  std::span<const std::pair<int, int>> pairs,
                                                  std::span<const double> q) {
  const RobotDescription& robot = tree.description();
  const auto on_link = spheres_on_links(robot);
  std::vector<Eigen::Vector3d> centres(robot.spheres.size());
  Scratch scratch;
  tree.sphere_centres(q, centres, scratch);
  std::vector<std::pair<int, int>> touching;
  for (const auto& [a, b] : pairs) {
    if (spheres_touch(robot, on_link, centres, a, b)) touching.emplace_back(a, b);
  }
  return touching;
}

std::string self_collision_block(const RobotDescription& robot,
                                 const std::vector<PairStatistics>& pairs,
                                 const SamplingOptions& options) {
  const auto name = [&](int link) { return robot.links[idx(link)].name; };
  std::string text =
      "self_collision:\n  # Found by sidestep_self_collision: " + std::to_string(options.samples) +
      " samples, seed " + std::to_string(options.seed) +
      ".\n  # Neighbours and pairs that always or never touch are left out.\n";
  std::string lines;
  for (const PairStatistics& pair : pairs) {
    if (pair.verdict != PairStatistics::Verdict::kChecked) continue;
    lines += "    - [" + name(pair.a) + ", " + name(pair.b) + "]\n";
  }
  return text + (lines.empty() ? "  pairs: []\n" : "  pairs:\n" + lines);
}

std::string with_self_collision(const std::string& profile, const std::string& block) {
  std::istringstream lines(profile);
  std::string out;
  std::string line;
  bool inside = false;
  bool placed = false;
  while (std::getline(lines, line)) {
    const bool starts_key = !line.empty() && line[0] != ' ' && line[0] != '#' && line[0] != '-';
    if (line.starts_with("self_collision:")) {
      inside = true;
      if (!placed) out += block;
      placed = true;
    } else if (!inside || starts_key || line.starts_with('#')) {
      inside = false;
      out += line + "\n";
    }
  }
  if (!placed) out += "\n" + block;
  return out;
}

}  // namespace sidestep
