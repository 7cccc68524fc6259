// Writes problem sets (docs/reference/problem_sets.md) for a Fetch that drives: parking beside a
// wall, a corridor with a bend, a door, and a pick-up across a room, all drawn at random. Starts
// and goals are clear of everything; whether there is a way is not looked at.
//
//   driving_problems FOLDER [COUNT [SEED]]
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "robot_testing.hpp"

namespace sidestep {
namespace {

constexpr double kMargin_m = 0.005;
constexpr double kWall_m = 0.1;
constexpr double kHigh_m = 1.6;

struct Furniture {
  std::string name;
  Eigen::Vector3d size_m;
  Eigen::Vector3d centre_m;
};

struct Drawn {
  std::vector<Furniture> furniture;
  Eigen::VectorXd start, goal;
};

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : engine_(seed) {}
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  bool coin() { return between(0.0, 1.0) < 0.5; }

 private:
  std::mt19937_64 engine_;
};

/// From corner to corner, from the floor up.
Furniture block(std::string name, double x0, double y0, double x1, double y1, double top_m,
                double bottom_m = 0.0) {
  return {std::move(name),
          {x1 - x0, y1 - y0, top_m - bottom_m},
          {0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (top_m + bottom_m)}};
}

class Families {
 public:
  explicit Families(const KinematicTree& robot) : robot_(robot.description()) {}

  /// Beside a wall between two pieces of furniture, from the lane before them.
  [[nodiscard]] Drawn parking(Draw& draw) const {
    const double bay_m = draw.between(0.95, 1.3), lane_m = draw.between(1.1, 1.5);
    const double depth_m = draw.between(0.6, 0.8), top_m = draw.between(0.3, 1.2);
    Drawn drawn;
    drawn.furniture = {
        block("wall", -3.0, depth_m + 0.1, 3.0, depth_m + 0.1 + kWall_m, kHigh_m),
        block("before", -3.0, 0.0, -0.5 * bay_m, depth_m + 0.1, top_m),
        block("behind", 0.5 * bay_m, 0.0, 3.0, depth_m + 0.1, draw.between(0.3, 1.2)),
        block("opposite", -3.0, -lane_m - kWall_m, 3.0, -lane_m, kHigh_m)};
    drawn.start = pose("tuck", draw.between(-2.4, -1.0), -0.5 * lane_m + draw.between(-0.1, 0.1),
                       draw.between(-0.3, 0.3) + (draw.coin() ? 0.0 : std::numbers::pi));
    drawn.goal = pose("tuck", draw.between(-0.05, 0.05), 0.5 * depth_m + draw.between(-0.05, 0.05),
                      draw.between(-0.1, 0.1));
    return drawn;
  }

  /// Round a bend.
  [[nodiscard]] Drawn corridor(Draw& draw) const {
    const double first_m = draw.between(1.0, 1.3), second_m = draw.between(1.0, 1.3);
    Drawn drawn;
    // Along x with y in [0, first], then along y with x in [0, second].
    drawn.furniture = {
        block("left", -4.0, first_m, 0.0, first_m + kWall_m, kHigh_m),
        block("right", -4.0, -kWall_m, second_m + kWall_m, 0.0, kHigh_m),
        block("outer", second_m, 0.0, second_m + kWall_m, 4.0, kHigh_m),
        block("inner", -kWall_m, first_m, 0.0, 4.0, kHigh_m),
        block("cupboard", -2.2, first_m - draw.between(0.05, 0.2), -1.6, first_m, kHigh_m)};
    const double turn = draw.coin() ? 0.0 : std::numbers::pi;
    drawn.start = pose("tuck", draw.between(-3.2, -2.6), 0.5 * first_m + draw.between(-0.1, 0.1),
                       draw.between(-0.4, 0.4) + turn);
    drawn.goal =
        pose("tuck", 0.5 * second_m + draw.between(-0.1, 0.1), first_m + draw.between(1.2, 2.2),
             0.5 * std::numbers::pi + draw.between(-0.4, 0.4));
    return drawn;
  }

  /// Through a wall.
  [[nodiscard]] Drawn door(Draw& draw) const {
    const double width_m = draw.between(0.8, 1.0), at_m = draw.between(-1.0, 1.0);
    Drawn drawn;
    drawn.furniture = {
        block("wall", -0.1, -3.0, 0.0, at_m - 0.5 * width_m, kHigh_m),
        block("wall_2", -0.1, at_m + 0.5 * width_m, 0.0, 3.0, kHigh_m),
        block("lintel", -0.1, at_m - 0.5 * width_m, 0.0, at_m + 0.5 * width_m, 2.3, 2.0)};
    // The door itself, wide open.
    drawn.furniture.push_back(
        block("door", 0.0, at_m + 0.5 * width_m, width_m, at_m + 0.5 * width_m + 0.04, kHigh_m));
    drawn.start = pose("tuck", draw.between(-2.2, -0.9), draw.between(-1.8, 1.8),
                       draw.between(-std::numbers::pi, std::numbers::pi));
    drawn.goal = pose("tuck", draw.between(0.9, 2.2), draw.between(-1.8, 1.8),
                      draw.between(-std::numbers::pi, std::numbers::pi));
    return drawn;
  }

  /// From beyond the furniture to reaching down over a table.
  [[nodiscard]] Drawn pick_up(Draw& draw) const {
    const double height_m = draw.between(0.4, 0.55);
    Drawn drawn;
    drawn.furniture = {block("table", 1.0, -0.6, 1.7, 0.6, height_m, height_m - 0.05),
                       block("leg", 1.3, -0.5, 1.4, 0.5, height_m - 0.05)};
    for (const char* name : {"chair", "crate", "shelf", "plant"}) {
      const double x = draw.between(-1.8, 0.3), y = draw.between(-1.8, 1.8);
      drawn.furniture.push_back(block(name, x, y, x + draw.between(0.2, 0.5),
                                      y + draw.between(0.2, 0.5), draw.between(0.4, 1.5)));
    }
    drawn.furniture.push_back(block("wall", -2.6, -2.6, -2.5, 2.6, kHigh_m));
    drawn.furniture.push_back(block("wall_2", -2.6, 2.5, 2.6, 2.6, kHigh_m));
    drawn.furniture.push_back(block("wall_3", -2.6, -2.6, 2.6, -2.5, kHigh_m));
    drawn.start = pose("tuck", draw.between(-2.0, -1.0), draw.between(-1.8, 1.8),
                       draw.between(-std::numbers::pi, std::numbers::pi));
    drawn.goal = pose("reach_table", draw.between(0.4, 0.55), draw.between(-0.3, 0.3),
                      draw.between(-0.3, 0.3));
    return drawn;
  }

 private:
  [[nodiscard]] Eigen::VectorXd pose(const char* name, double x_m, double y_m, double yaw) const {
    Eigen::VectorXd q = Eigen::VectorXd::Zero(robot_.dof());
    const NamedPose* arm = robot_.find_pose(name);
    for (std::size_t j = 0; j < robot_.joints.size(); ++j) {
      q[static_cast<Eigen::Index>(j)] = arm->positions[j].value_or(0.0);
    }
    q.head<3>() << x_m, y_m, yaw;
    return q;
  }

  const RobotDescription& robot_;
};

bool is_clear(const std::shared_ptr<const KinematicTree>& robot, const Drawn& drawn) {
  std::vector<SceneObject> objects;
  for (const Furniture& one : drawn.furniture) {
    SceneObject object;
    object.name = one.name;
    object.shape = Box{one.size_m};
    object.waypoints.resize(1);
    object.waypoints[0].T_world_object.translation() = one.centre_m;
    objects.push_back(std::move(object));
  }
  const auto field = std::make_shared<const SceneField>(
      Scene(std::move(objects)), Stamp(),
      Eigen::AlignedBox3d(Eigen::Vector3d(-8, -8, -8), Eigen::Vector3d(8, 8, 8)));
  const FieldChecks checks(robot);
  const auto clear = [&](const Eigen::VectorXd& q) {
    return !checks.state_violation(field, {Space::kFree, Space::kFree}, kMargin_m,
                                   {q.data(), static_cast<std::size_t>(q.size())});
  };
  return clear(drawn.start) && clear(drawn.goal);
}

nlohmann::json to_json(const Drawn& drawn, int index) {
  const auto list = [](const auto& vector) {
    return std::vector<double>(vector.data(), vector.data() + vector.size());
  };
  nlohmann::json obstacles = nlohmann::json::array();
  for (const Furniture& one : drawn.furniture) {
    obstacles.push_back({{"name", one.name},
                         {"type", "box"},
                         {"size", list(one.size_m)},
                         {"position", list(one.centre_m)},
                         {"quaternion_xyzw", {0.0, 0.0, 0.0, 1.0}}});
  }
  return {{"index", index},
          {"start", list(drawn.start)},
          {"goals", {list(drawn.goal)}},
          {"obstacles", std::move(obstacles)}};
}

int run(const std::filesystem::path& folder, int count, std::uint64_t seed) {
  testing_robot::Loader loader;
  auto loaded = loader.load("{profile: fetch, group: whole_body}");
  if (!loaded) {
    std::fprintf(stderr, "%s\n", loaded.error().describe().c_str());
    return 1;
  }
  const std::shared_ptr<const KinematicTree> robot = std::move(*loaded);
  const Families families(*robot);
  nlohmann::json names = nlohmann::json::array();
  for (const Joint& joint : robot->description().joints) names.push_back(joint.name);
  std::filesystem::create_directories(folder);
  using Family = Drawn (Families::*)(Draw&) const;
  const std::pair<const char*, Family> all[] = {{"parking", &Families::parking},
                                                {"corridor", &Families::corridor},
                                                {"door", &Families::door},
                                                {"pick_up", &Families::pick_up}};
  for (const auto& [name, family] : all) {
    Draw draw(seed);
    nlohmann::json problems = nlohmann::json::array();
    while (static_cast<int>(problems.size()) < count) {
      const Drawn drawn = (families.*family)(draw);
      if (!is_clear(robot, drawn)) continue;
      problems.push_back(to_json(drawn, static_cast<int>(problems.size()) + 1));
    }
    std::ofstream(folder / (std::string(name) + ".json"))
        << nlohmann::json{{"format", "mbm-neutral/1"},
                          {"family", name},
                          {"joint_names", names},
                          {"problems", std::move(problems)}};
  }
  return 0;
}

}  // namespace
}  // namespace sidestep

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fputs("usage: driving_problems FOLDER [COUNT [SEED]]\n", stderr);
    return 2;
  }
  return sidestep::run(argv[1], argc > 2 ? std::atoi(argv[2]) : 100,
                       argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1);
}
