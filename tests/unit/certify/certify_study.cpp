// Paths of a plain driver of OMPL, certified (docs/studies/certify.md): RRT-Connect whose motions
// are looked at where OMPL's defaults look, by FCL among the true shapes. Each proof is held
// against FCL at instants so many rad of the fastest joint apart, each witness at its instant.
//
//   certify_study PROBLEMS|random|hard|ROBOT.urdf [COUNT [INSTANT_RAD [FOLDER]]]
//
// FOLDER, which must be there, is left the certificates. Times are with them.
//
// With a URDF: its own robot, whose shapes are mostly meshes, in random worlds, and beside it what
// FCL's continuous collision takes for the same motions, a rigid one for each 0.05 rad of them.
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/SimpleSetup.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>
#include <ompl/util/RandomNumbers.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include <fcl/geometry/geometric_shape_to_BVH_model.h>
#include <fcl/narrowphase/continuous_collision.h>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/problems/problem_set.hpp>

#include "certify_testing.hpp"
#include "robot_testing.hpp"
#include "shape_collider.hpp"

namespace sidestep {
namespace {

namespace ob = ompl::base;
namespace og = ompl::geometric;
using Configuration = std::vector<double>;

double now_ms() {
  return std::chrono::duration<double, std::milli>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

/// Whether FCL finds a contact at an instant.
class Fcl {
 public:
  Fcl(const KinematicTree& robot, const Scene& scene)
      : robot_(robot), links_(robot.description().links.size()) {
    ShapeObstacles obstacles;
    obstacles.scene = std::make_shared<const Scene>(scene);
    collider_ = std::make_unique<ShapeCollider>(robot.description(), obstacles,
                                                std::vector<AllowedContact>{});
    pose_ = collider_->make_pose();
    const auto place = [&](double q) {
      robot.link_poses(Configuration(robot.description().joints.size(), q), links_, scratch_);
      return links_;
    };
    const auto before = place(0.1), after = place(0.4);
    for (const CollisionShape& shape : robot.description().shapes) {
      moves_.push_back(!before[idx(shape.link)].isApprox(after[idx(shape.link)], 1e-9));
    }
  }
  [[nodiscard]] bool touches(std::span<const double> q) {
    robot_.link_poses(q, links_, scratch_);
    collider_->place(*pose_, links_, 0.0);
    for (int s = 0; s < collider_->shape_count(); ++s) {
      if (!moves_[idx(s)]) continue;
      if (collider_->gap_to_obstacles_m(s, *pose_, 1e-3) <= 0.0) return true;
    }
    for (int p = 0; p < collider_->pair_count(); ++p) {
      if (collider_->gap_between_pair_m(p, *pose_, 1e-3) <= 0.0) return true;
    }
    return false;
  }

 private:
  const KinematicTree& robot_;
  std::unique_ptr<ShapeCollider> collider_;
  ShapeCollider::PosePtr pose_;
  std::vector<Transform> links_;
  std::vector<bool> moves_;  ///< Shapes.
  Scratch scratch_;
};

/// FCL's conservative advancement of each shape against each object of a scene.
class FclContinuous {
 public:
  FclContinuous(const KinematicTree& robot, const Scene& scene) : robot_(robot) {
    for (const CollisionShape& shape : robot.description().shapes) {
      links_.push_back(mesh_of(shape.shape));
    }
    for (const SceneObject& object : scene.objects()) {
      objects_.emplace_back(mesh_of(object.shape), object.T_world_object(0.0));
    }
  }
  /// How long it looks at a straight motion, and whether it finds a contact.
  [[nodiscard]] std::pair<double, bool> look(const Configuration& from, const Configuration& to) {
    const double begin_ms = now_ms();
    double longest_rad = 0.0;
    for (std::size_t j = 0; j < from.size(); ++j) {
      longest_rad = std::max(longest_rad, std::abs(to[j] - from[j]));
    }
    const int steps = std::max(1, static_cast<int>(std::ceil(longest_rad / 0.05)));
    std::vector<Transform> before = poses(from, to, 0.0);
    for (int i = 1; i <= steps; ++i) {
      const std::vector<Transform> after = poses(from, to, static_cast<double>(i) / steps);
      for (std::size_t s = 0; s < links_.size(); ++s) {
        if (before[s].isApprox(after[s], 1e-12)) continue;
        for (const auto& [object, T_world_object] : objects_) {
          fcl::ContinuousCollisionRequestd request(20, 1e-4, fcl::CCDM_LINEAR, fcl::GST_LIBCCD,
                                                   fcl::CCDC_CONSERVATIVE_ADVANCEMENT);
          fcl::ContinuousCollisionResultd result;
          fcl::continuousCollide(links_[s].get(), fcl::Transform3d(before[s].matrix()),
                                 fcl::Transform3d(after[s].matrix()), object.get(),
                                 fcl::Transform3d(T_world_object.matrix()),
                                 fcl::Transform3d(T_world_object.matrix()), request, result);
          if (result.is_collide) return {now_ms() - begin_ms, true};
        }
      }
      before = after;
    }
    return {now_ms() - begin_ms, false};
  }

 private:
  using BvhModel = fcl::BVHModel<fcl::OBBRSSd>;

  [[nodiscard]] std::vector<Transform> poses(const Configuration& from, const Configuration& to,
                                             double share) {
    Configuration q = from;
    for (std::size_t j = 0; j < q.size(); ++j) q[j] += share * (to[j] - from[j]);
    std::vector<Transform> links(robot_.description().links.size()), shapes;
    robot_.link_poses(q, links, scratch_);
    for (const CollisionShape& shape : robot_.description().shapes) {
      shapes.push_back(links[idx(shape.link)] * shape.T_link_shape);
    }
    return shapes;
  }
  /// Of meshes and boxes.
  static std::shared_ptr<BvhModel> mesh_of(const Shape& shape) {
    auto model = std::make_shared<BvhModel>();
    if (const auto* const box = std::get_if<Box>(&shape)) {
      fcl::generateBVHModel(*model, fcl::Boxd(box->size_m), fcl::Transform3d::Identity());
      return model;
    }
    const Mesh& mesh = *std::get<std::shared_ptr<const Mesh>>(shape);
    std::vector<fcl::Triangle> triangles;
    for (const Eigen::Vector3i& t : mesh.triangles) {
      triangles.emplace_back(idx(t[0]), idx(t[1]), idx(t[2]));
    }
    model->beginModel();
    model->addSubModel({mesh.vertices_m.begin(), mesh.vertices_m.end()}, triangles);
    model->endModel();
    return model;
  }

  const KinematicTree& robot_;
  std::vector<std::shared_ptr<BvhModel>> links_;
  std::vector<std::pair<std::shared_ptr<BvhModel>, Transform>> objects_;
  Scratch scratch_;
};

/// Simplified; empty where there is none within 10 s.
std::vector<Configuration> plan(const RobotDescription& robot, const Eigen::VectorXd& q_start,
                                const Eigen::VectorXd& q_goal, Fcl& fcl) {
  const auto space = std::make_shared<ob::RealVectorStateSpace>(robot.joints.size());
  ob::RealVectorBounds bounds(static_cast<unsigned>(robot.joints.size()));
  for (std::size_t j = 0; j < robot.joints.size(); ++j) {
    bounds.setLow(static_cast<unsigned>(j), robot.joints[j].lower);
    bounds.setHigh(static_cast<unsigned>(j), robot.joints[j].upper);
  }
  space->setBounds(bounds);
  og::SimpleSetup setup(space);
  setup.setStateValidityChecker([&](const ob::State* state) {
    const double* const q = state->as<ob::RealVectorStateSpace::StateType>()->values;
    return space->satisfiesBounds(state) && !fcl.touches({q, robot.joints.size()});
  });
  ob::ScopedState<> start(space), goal(space);
  for (unsigned j = 0; j < robot.joints.size(); ++j) {
    start[j] = q_start[j];
    goal[j] = q_goal[j];
  }
  setup.setStartAndGoalStates(start, goal);
  setup.setPlanner(std::make_shared<og::RRTConnect>(setup.getSpaceInformation()));
  if (setup.solve(10.0) != ob::PlannerStatus::EXACT_SOLUTION) return {};
  setup.simplifySolution(1.0);
  std::vector<Configuration> path;
  for (const ob::State* state : setup.getSolutionPath().getStates()) {
    const double* const q = state->as<ob::RealVectorStateSpace::StateType>()->values;
    path.emplace_back(q, q + robot.joints.size());
  }
  return path;
}

bool touches(const std::vector<Configuration>& path, double instant_rad, Fcl& fcl) {
  for (std::size_t k = 0; k + 1 < path.size(); ++k) {
    double longest = 0.0;
    for (std::size_t j = 0; j < path[k].size(); ++j) {
      longest = std::max(longest, std::abs(path[k + 1][j] - path[k][j]));
    }
    const int steps = std::max(1, static_cast<int>(std::ceil(longest / instant_rad)));
    for (int i = 0; i <= steps; ++i) {
      Configuration q = path[k];
      for (std::size_t j = 0; j < q.size(); ++j) {
        q[j] += static_cast<double>(i) / steps * (path[k + 1][j] - q[j]);
      }
      if (fcl.touches(q)) return true;
    }
  }
  return false;
}

/// Verdicts on paths, each held against FCL.
class Tally {
 public:
  Tally(const KinematicTree& robot, double instant_rad, std::string folder)
      : robot_(robot), instant_rad_(instant_rad), folder_(std::move(folder)) {
    if (!folder_.empty()) std::filesystem::create_directories(folder_);
  }

  std::string_view add(const std::string& name, const Scene& scene,
                       const std::vector<Configuration>& path, Fcl& fcl) {
    PolynomialMotion motion = testing_certify::straight(path);
    motion.has_times = false;
    const double begin_ms = now_ms();
    const auto found = certify(robot_, {scene, {}, {}}, motion, {.wants_certificate = true});
    times_ms_.push_back(now_ms() - begin_ms);
    if (!found) throw std::runtime_error(found.error().describe());
    parts_ += found->parts;
    pairs_ += found->pairs;
    ++counts_[static_cast<std::size_t>(found->outcome)];
    if (!folder_.empty() && !found->certificate.empty()) {
      std::ofstream(folder_ + format("/%zu ", times_ms_.size()) + name + ".json")
          << found->certificate;
    }
    if (const auto& witness = found->witness) {
      const auto k = std::min(static_cast<std::size_t>(witness->time_s), path.size() - 2);
      Configuration q = path[k];
      for (std::size_t j = 0; j < q.size(); ++j) {
        q[j] += (witness->time_s - static_cast<double>(k)) * (path[k + 1][j] - path[k][j]);
      }
      unconfirmed_ += fcl.touches(q) ? 0 : 1;
    } else {
      missed_ += touches(path, instant_rad_, fcl) ? 1 : 0;
    }
    for (const Undecided& one : found->undecided) {
      std::printf("undecided: %s: %s and %s from %.9f to %.9f s\n", name.c_str(), one.a.c_str(),
                  one.b.c_str(), one.from_s, one.to_s);
    }
    return name_of(found->outcome);
  }

  void add_continuous(double time_ms, bool touches) {
    continuous_ms_.push_back(time_ms);
    continuous_touches_ += touches ? 1 : 0;
  }

  [[nodiscard]] int conclude() {
    if (times_ms_.empty()) return 1;
    const auto print_times = [](const char* what, std::vector<double>& ms) {
      std::ranges::sort(ms);
      const auto at = [&](double share) {
        return ms[static_cast<std::size_t>(share * static_cast<double>(ms.size() - 1))];
      };
      std::printf("%s: p50 %.2f ms, p95 %.2f ms, most %.2f ms\n", what, at(0.5), at(0.95), at(1.0));
    };
    const auto count = [&](Certification::Outcome outcome) {
      return counts_[static_cast<std::size_t>(outcome)];
    };
    std::printf("%zu paths: %d proven, %d refuted, %d undecided\n", times_ms_.size(),
                count(Certification::Outcome::kProven), count(Certification::Outcome::kRefuted),
                count(Certification::Outcome::kUndecided));
    std::printf(
        "FCL finds a contact in %d that are not refuted, and confirms all but %d witnesses\n",
        missed_, unconfirmed_);
    std::printf("%.1f parts a pair of shapes\n",
                static_cast<double>(parts_) / static_cast<double>(pairs_));
    print_times("time", times_ms_);
    if (!continuous_ms_.empty()) {
      print_times("FCL's continuous collision", continuous_ms_);
      std::printf("which finds a contact in %d\n", continuous_touches_);
    }
    return missed_ + unconfirmed_ == 0 ? 0 : 1;
  }

 private:
  const KinematicTree& robot_;
  double instant_rad_;
  std::string folder_;  ///< For certificates; empty: none.
  std::size_t parts_ = 0, pairs_ = 0;
  std::array<int, 3> counts_{};
  int missed_ = 0, unconfirmed_ = 0;
  std::vector<double> times_ms_, continuous_ms_;
  int continuous_touches_ = 0;
};

/// What a hand has to be brought out of and into.
struct HardWorld {
  struct Slab {
    Eigen::Vector3d middle_m, size_m;
  };
  const char* name = "";
  std::vector<Slab> slabs;
  Eigen::Vector3d from_m, to_m;  ///< The middles of cubes of 0.2 m.
};

/// Seven before an arm at the origin, as those are that ARMOUR and SPARROWS call hard. `open_m`:
/// half of what is left open.
std::vector<HardWorld> hard_worlds(double open_m) {
  const double w = open_m, t = 0.04;
  const auto bin = [&](double y) {
    return std::vector<HardWorld::Slab>{{{0.5 - w, y, 0.15}, {t, 2 * w, 0.3}},
                                        {{0.5 + w, y, 0.15}, {t, 2 * w, 0.3}},
                                        {{0.5, y - w, 0.15}, {2 * w, t, 0.3}},
                                        {{0.5, y + w, 0.15}, {2 * w, t, 0.3}}};
  };
  std::vector<HardWorld::Slab> bins = bin(-0.3), posts, shelves{{{0.8, 0, 0.5}, {t, 1, 1}}};
  for (const HardWorld::Slab& side : bin(0.3)) bins.push_back(side);
  for (const double y : {-3 * w, -w, w, 3 * w}) {
    posts.push_back({{0.5, y, 0.5}, {t, t, 1.0}});
  }
  for (const double side : {-1.0, 1.0}) {
    shelves.push_back({{0.65, side * 0.5, 0.5}, {0.3, t, 1.0}});
    shelves.push_back({{0.65, 0.0, 0.5 + side * 2 * w}, {0.3, 1.0, t}});
  }
  shelves.push_back({{0.65, 0.0, 0.5}, {0.3, 1.0, t}});
  return {
      {"table", {{{0.6, 0, 0.35}, {0.6, 2 * w + 0.6, t}}}, {0.5, 0, 0.15}, {0.5, 0, 0.6}},
      {"wall", {{{0.6, 0, 0.3}, {0.6, t, 0.9 - w}}}, {0.5, -0.3, 0.3}, {0.5, 0.3, 0.3}},
      {"shelves", shelves, {0.55, 0, 0.5 - w}, {0.55, 0, 0.5 + w}},
      {"posts", posts, {0.55, -2 * w, 0.5}, {0.55, 2 * w, 0.5}},
      {"bins", bins, {0.5, -0.3, 0.25}, {0.5, 0.3, 0.25}},
      {"window",
       {{{0.5, 0.5 + w, 0.5}, {t, 1, 1}},
        {{0.5, -0.5 - w, 0.5}, {t, 1, 1}},
        {{0.5, 0, 0.25 - 0.5 * w}, {t, 2 * w, 0.5 - w}},
        {{0.5, 0, 0.75 + 0.5 * w}, {t, 2 * w, 0.5 - w}}},
       {0.35, 0.1, 0.5},
       {0.6, 0, 0.5}},
      {"slot",
       {{{0.6, 0, 0.4 - w}, {0.6, 0.5, t}}, {{0.6, 0, 0.4 + w}, {0.6, 0.5, t}}},
       {0.5, 0, 0.4},
       {0.4, 0.45, 0.6}},
  };
}

/// Paths of OMPL through 14 of them.
int study_hard(const KinematicTree& robot, Tally& tally) {
  std::mt19937_64 random(1);
  Scratch scratch;
  std::vector<Transform> links(robot.description().links.size());
  const int hand = robot.description().link_index("panda_hand").value();
  for (const double open_m : {0.2, 0.16}) {
    for (const HardWorld& world : hard_worlds(open_m)) {
      std::vector<SceneObject> objects;
      for (const auto& [middle_m, size_m] : world.slabs) {
        objects.push_back(testing_certify::object("slab", Box{size_m}, middle_m));
      }
      const Scene scene(objects);
      Fcl fcl(robot, scene);
      const auto clear_at = [&](const Eigen::Vector3d& middle_m) {
        Eigen::VectorXd q(robot.description().dof());
        do {
          for (Eigen::Index j = 0; j < q.size(); ++j) {
            const Joint& joint = robot.description().joints[idx(j)];
            q[j] = std::uniform_real_distribution(joint.lower, joint.upper)(random);
          }
          robot.link_poses({q.data(), idx(q.size())}, links, scratch);
        } while ((links[idx(hand)].translation() - middle_m).cwiseAbs().maxCoeff() > 0.1 ||
                 fcl.touches({q.data(), idx(q.size())}));
        return q;
      };
      const Eigen::VectorXd from = clear_at(world.from_m);
      const auto path = plan(robot.description(), from, clear_at(world.to_m), fcl);
      std::printf("%s, %.2f m open: ", world.name, 2 * open_m);
      if (path.size() < 2) {
        std::printf("no path\n");
        continue;
      }
      std::printf("%s\n", tally.add(world.name, scene, path, fcl).data());
    }
  }
  return tally.conclude();
}

/// Straight motions through worlds of 10 to 40 boxes with sides of 2 to 20 cm, between
/// configurations that are clear.
int study_random(const KinematicTree& robot, int worlds, bool with_continuous, Tally& tally) {
  std::mt19937_64 random(1);
  const auto draw = [&](double lower, double upper) {
    return std::uniform_real_distribution(lower, upper)(random);
  };
  for (int world = 0; world < worlds; ++world) {
    std::vector<SceneObject> objects;
    for (int i = 0; i < 10 * (1 << world % 3); ++i) {
      const Eigen::Vector3d p(draw(-0.9, 0.9), draw(-0.9, 0.9), draw(0.0, 1.1));
      const Box box{{draw(0.02, 0.2), draw(0.02, 0.2), draw(0.02, 0.2)}};
      if (p.head<2>().norm() < 0.25) continue;  // where it stands
      objects.push_back(testing_certify::object("box" + std::to_string(i), box, p));
    }
    const Scene scene(objects);
    Fcl fcl(robot, scene);
    const auto clear = [&] {
      Configuration q;
      do {
        q.clear();
        for (const Joint& joint : robot.description().joints) {
          q.push_back(draw(joint.lower, joint.upper));
        }
      } while (fcl.touches(q));
      return q;
    };
    const Configuration from = clear();
    // As far as a planner with a receding horizon goes at once.
    Configuration to = from;
    do {
      for (std::size_t j = 0; j < to.size(); ++j) {
        const Joint& joint = robot.description().joints[j];
        to[j] = std::clamp(from[j] + draw(-0.6, 0.6), joint.lower, joint.upper);
      }
    } while (fcl.touches(to));
    tally.add("world " + std::to_string(world), scene, {from, to}, fcl);
    if (!with_continuous) continue;
    const auto [time_ms, touches] = FclContinuous(robot, scene).look(from, to);
    tally.add_continuous(time_ms, touches);
  }
  return tally.conclude();
}

int study(const std::string& problems_folder, std::size_t most, double instant_rad,
          const std::string& certificates) {
  testing_robot::Loader loader;
  if (problems_folder.ends_with(".urdf")) {
    const auto folder = std::filesystem::path(problems_folder).parent_path().string();
    const auto robot = loader.load_or_fail(
        "{urdf: " + problems_folder + ", base: fixed, tip_link: wrist_3_link, package_paths: [" +
        folder + "]}");
    Tally tally(*robot, instant_rad, certificates);
    return study_random(*robot, static_cast<int>(most), true, tally);
  }
  const auto robot = loader.load_or_fail(
      "{profile: panda, fixed_joints: {panda_finger_joint1: 0.065}, joint_limits: "
      "{panda_finger_joint1: {upper: 0.065}, panda_joint1: {lower: -2.9671, upper: 2.9671}, "
      "panda_joint2: {lower: -1.8326, upper: 1.8326}, "
      "panda_joint3: {lower: -2.9671, upper: 2.9671}, panda_joint4: {lower: -3.1416, upper: "
      "0.0873}, panda_joint5: {lower: -2.9671, upper: 2.9671}, panda_joint6: {lower: -0.0873, "
      "upper: 3.8223}, panda_joint7: {lower: -2.9671, upper: 2.9671}}}");
  Tally tally(*robot, instant_rad, certificates);
  ompl::msg::setLogLevel(ompl::msg::LOG_NONE);
  ompl::RNG::setSeed(1);
  if (problems_folder == "hard") return study_hard(*robot, tally);
  if (problems_folder == "random") return study_random(*robot, 100, false, tally);
  const auto problems = read_problem_set(problems_folder, robot->description());
  if (!problems) {
    std::fprintf(stderr, "%s\n", problems.error().describe().c_str());
    return 2;
  }
  for (std::size_t i = 0; i < problems->size() && i < most; ++i) {
    const SetProblem& problem = (*problems)[i];
    Fcl fcl(*robot, *problem.scene);
    const auto path = plan(robot->description(), problem.q_start, problem.q_goal, fcl);
    if (path.size() < 2) continue;
    tally.add(problem.family + " " + std::to_string(problem.index), *problem.scene, path, fcl);
  }
  return tally.conclude();
}

}  // namespace
}  // namespace sidestep

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  const std::size_t most = argc > 2 ? std::strtoul(argv[2], nullptr, 10) : 100000;
  return sidestep::study(argv[1], most, argc > 3 ? std::strtod(argv[3], nullptr) : 1e-3,
                         argc > 4 ? argv[4] : "");
}
