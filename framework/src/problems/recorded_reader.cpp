#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>

#include <sidestep/core/index.hpp>
#include <sidestep/problems/recorded_problems.hpp>
#include <sidestep/robot/kinematic_tree.hpp>
#include <sidestep/robot/robot_model.hpp>

#include "document_entry.hpp"

namespace sidestep {
namespace {

/// The recorded problems know no limits.
constexpr double kNoLimit = 1e6;

/// A chain of links, put together from the world outwards.
class Chain {
 public:
  explicit Chain(std::string name) : tree_(1) {
    description_.name = std::move(name);
    description_.links.push_back({"world", -1});
  }

  [[nodiscard]] int joints() const { return description_.dof(); }

  void slide(const std::string& name, const Eigen::Vector3d& axis,
             const Transform& T_parent_joint) {
    add(name, TreeJoint::Motion::kTranslation, axis, T_parent_joint, 0.0);
    description_.joints.push_back(
        {name, Joint::Type::kPrismatic, -kNoLimit, kNoLimit, kNoLimit, kInfinity});
  }
  void turn(const std::string& name, const Transform& T_parent_joint, double bias) {
    add(name, TreeJoint::Motion::kRotation, Eigen::Vector3d::UnitZ(), T_parent_joint, bias);
    description_.joints.push_back(
        {name, Joint::Type::kContinuous, -kInfinity, kInfinity, kNoLimit, kInfinity});
  }
  /// A sphere on the link that the joint with this index moves.
  void add_sphere(int joint, const Eigen::Vector3d& centre_m, double radius_m) {
    description_.spheres.push_back({joint + 1, centre_m, radius_m});
  }
  [[nodiscard]] Result<std::shared_ptr<const RobotModel>> finish() {
    auto made = SIDESTEP_TRY(KinematicTree::create(std::move(description_), std::move(tree_)));
    return std::shared_ptr<const RobotModel>(std::move(made));
  }

 private:
  void add(const std::string& name, TreeJoint::Motion motion, const Eigen::Vector3d& axis,
           const Transform& T_parent_joint, double bias) {
    TreeJoint joint;
    joint.name = name;
    joint.motion = motion;
    joint.T_parent_joint = T_parent_joint;
    joint.axis = axis;
    joint.joint = joints();
    joint.offset = bias;
    tree_.push_back(joint);
    description_.links.push_back({name, joints()});
  }

  RobotDescription description_;
  std::vector<TreeJoint> tree_;
};

/// The joints of an arm. `after` are the transforms from each joint, past its motion, to its frame:
/// in the classical convention the twist comes after the joint.
void add_arm(const JsonEntry& robot, std::size_t count, const Transform& T_parent_arm, Chain& chain,
             std::vector<Transform>& after) {
  const std::string convention = robot["dh"].text();
  const bool modified = convention.starts_with("modified");
  if (!modified && !convention.starts_with("classical")) {
    robot["dh"].complain("the convention must begin with \"modified\" or \"classical\"");
  }
  const Eigen::VectorXd a = robot["a"].numbers(count), d = robot["d"].numbers(count);
  const Eigen::VectorXd alpha = robot["alpha"].numbers(count);
  Eigen::VectorXd bias = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(count));
  if (robot.has("theta_bias")) bias = robot["theta_bias"].numbers(count);
  Transform T_parent = T_parent_arm;
  for (Eigen::Index i = 0; i < bias.size(); ++i) {
    Transform twist = Transform::Identity();
    twist.rotate(Eigen::AngleAxisd(alpha[i], Eigen::Vector3d::UnitX()));
    const std::string name = "joint_" + std::to_string(chain.joints() + 1);
    const Eigen::Vector3d along(a[i], 0.0, 0.0), up(0.0, 0.0, d[i]);
    if (modified) {
      chain.turn(name, T_parent * twist * Eigen::Translation3d(along + up), bias[i]);
      T_parent = Transform::Identity();
      after.push_back(Transform::Identity());
    } else {
      chain.turn(name, T_parent, bias[i]);
      T_parent = Eigen::Translation3d(up + along) * twist;
      after.push_back(T_parent);
    }
  }
}

Transform translation(const Eigen::Vector3d& by) { return Transform(Eigen::Translation3d(by)); }

/// x, y, heading and lift, below an arm.
void add_base(const JsonEntry& robot, Chain& chain) {
  chain.slide("base_x", Eigen::Vector3d::UnitX(), Transform::Identity());
  chain.slide("base_y", Eigen::Vector3d::UnitY(), Transform::Identity());
  chain.turn("base_heading", Transform::Identity(), 0.0);
  chain.slide("lift", Eigen::Vector3d::UnitZ(), translation(robot["base_T_torso"].vector3()));
}

/// The robot of a file of recorded problems.
struct RecordedRobot {
  std::shared_ptr<const RobotModel> model;  ///< Null where the file has an error.
  bool has_base = false;  ///< Its first three joints are x, y and heading of a mobile base.
};

/// Reads `robot`; `dof` is the size of the recorded configurations. Without `dh` it is a point that
/// moves along the first axes of the world.
Result<RecordedRobot> read_recorded_robot(const JsonEntry& robot, int dof) {
  constexpr int kHeadingJoint = 2, kBaseJoints = 4;
  robot.expect_keys(robot.has("dh")
                        ? std::vector<std::string>{"name", "spheres", "spheres_columns", "dh", "a",
                                                   "alpha", "d", "theta_bias", "base_T_torso",
                                                   "torso_T_arm", "base_pose", "lift", "state",
                                                   "joint_limit_factors", "sampling_limits_hi",
                                                   "sampling_limits_lo"}
                        : std::vector<std::string>{"name", "spheres", "spheres_columns"});
  if (robot.has("base_pose") && robot["base_pose"].text() != "identity") {
    robot["base_pose"].complain("only \"identity\" is supported");
  }
  if (robot.has("joint_limit_factors") && robot["joint_limit_factors"].flag()) {
    robot["joint_limit_factors"].complain("costs of joint limits are not supported");
  }
  RecordedRobot read;
  read.has_base = robot.has("base_T_torso");
  Chain chain(robot["name"].text());
  std::vector<Transform> after;
  int first_link = 0;  // the joint that moves the recording's link 0
  if (!robot.has("dh")) {
    if (dof > 3)
      robot.complain("a point moves along 3 axes at most, but the configurations have " +
                     std::to_string(dof) + " numbers");
    for (int axis = 0; axis < std::min(dof, 3); ++axis) {
      chain.slide(std::string(1, "xyz"[axis]), Eigen::Vector3d::Unit(axis), Transform::Identity());
    }
    first_link = chain.joints() - 1;
  } else if (read.has_base) {
    if (dof <= kBaseJoints)
      robot.complain("configurations of a mobile arm have more numbers than 4");
    add_base(robot, chain);
    add_arm(robot, static_cast<std::size_t>(std::max(0, dof - kBaseJoints)),
            translation(robot["torso_T_arm"].vector3()), chain, after);
    after.insert(after.begin(), kBaseJoints, Transform::Identity());
    first_link = kHeadingJoint;
  } else {
    add_arm(robot, static_cast<std::size_t>(dof), Transform::Identity(), chain, after);
  }
  after.resize(static_cast<std::size_t>(chain.joints()), Transform::Identity());
  for (const JsonEntry& sphere : robot["spheres"].items()) {
    const Eigen::VectorXd numbers = sphere.numbers(5);
    const int joint = first_link + sphere.at(0).integer(0, chain.joints() - 1 - first_link);
    const Eigen::Vector3d centre_m = numbers.segment<3>(1);
    chain.add_sphere(joint, after[idx(joint)] * centre_m, sphere.at(4).positive());
  }
  auto model = SIDESTEP_TRY(chain.finish());
  read.model = std::move(model);
  return read;
}

constexpr int kMostCounted = 1'000'000;
constexpr double kMostNodes = 1e8;

GridSpec read_grid(const JsonEntry& grid) {
  grid.expect_keys({"cell", "n", "origin", "definition"});
  GridSpec read;
  read.resolution_m = grid["cell"].positive();
  read.origin_m = grid["origin"].vector3().array() - 0.5 * read.resolution_m;
  const JsonEntry counts = grid["n"];
  (void)counts.vector3();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    read.size_vox[static_cast<Eigen::Index>(axis)] = counts.at(axis).integer(1, kMostCounted);
  }
  if (read.size_vox.cast<double>().prod() > kMostNodes) {
    counts.complain("the grid has more than 1e8 nodes");
  }
  return read;
}

std::vector<RecordedBox> read_scene(const JsonEntry& scene) {
  std::vector<RecordedBox> boxes;
  for (const JsonEntry& box : scene.items()) {
    box.expect_keys({"lo", "hi"});
    boxes.push_back({box["lo"].vector3(), box["hi"].vector3()});
    if (!(boxes.back().lower_m.array() <= boxes.back().upper_m.array()).all()) {
      box.complain("`lo` lies above `hi`");
    }
  }
  return boxes;
}

RecordedSettings read_settings(const JsonEntry& settings) {
  settings.expect_keys({"states", "total_step", "total_time_s", "Qc_diag", "obs_check_inter",
                        "epsilon", "cost_sigma", "conf_prior_sigma", "vel_prior_sigma", "start_vel",
                        "goal_vel", "gp_prior_factors", "obstacle_factors", "init", "optimizer"});
  RecordedSettings read;
  read.support_states = settings["states"].integer(3, 10'000);
  const int intervals = settings["total_step"].integer(1, 10'000);
  if (intervals + 1 != read.support_states) {
    settings["states"].complain("there is one state more than `total_step`, " +
                                std::to_string(intervals) + ", and not " +
                                std::to_string(read.support_states));
  }
  read.dt_s = settings["total_time_s"].positive() / intervals;
  read.qc = settings["Qc_diag"].positive();
  read.interpolated_checks = settings["obs_check_inter"].integer(0, 1000);
  read.epsilon_m = settings["epsilon"].number();
  read.sigma_obstacle_m = settings["cost_sigma"].positive();
  read.sigma_endpoint = settings["conf_prior_sigma"].positive();
  if (settings["vel_prior_sigma"].positive() != read.sigma_endpoint) {
    settings["vel_prior_sigma"].complain("only as large as `conf_prior_sigma` is supported");
  }
  for (const char* velocity : {"start_vel", "goal_vel"}) {
    if (settings[velocity].number() != 0.0) {
      settings[velocity].complain("only motions from rest to rest are supported");
    }
  }
  return read;
}

/// Where in a row of results each number stands.
class Columns {
 public:
  explicit Columns(const JsonEntry& names) : count_(names.size()) {
    std::map<std::string, std::size_t> columns;
    for (std::size_t column = 0; column < count_; ++column) {
      columns[names.at(column).text()] = column;
    }
    for (std::size_t k = 0; k < kNames.size(); ++k) {
      if (!columns.contains(kNames[k])) {
        names.complain(std::string("there is no column `") + kNames[k] + "`");
      }
      at_[k] = columns[kNames[k]];
    }
  }

  [[nodiscard]] RecordedOutcome read(const JsonEntry& row, int scenes, int pairs) const {
    RecordedOutcome outcome;
    if (row.size() != count_) {
      row.complain("there are " + std::to_string(row.size()) +
                   " values, but `result_columns` has " + std::to_string(count_));
    }
    const auto value = [&](std::size_t k) { return row.at(at_[k]); };
    outcome.scene = value(0).integer(0, scenes - 1);
    outcome.pair = value(1).integer(0, pairs - 1);
    outcome.iterations = value(2).integer(-1, kMostCounted);
    outcome.initial_cost = value(3).number();
    outcome.final_cost = value(4).number();
    outcome.free_at_checks = value(5).flag();
    outcome.free_exactly = value(6).flag();
    outcome.total_ms = 1e-3 * value(7).number();
    outcome.optimise_ms = 1e-3 * value(8).number();
    return outcome;
  }

 private:
  static constexpr std::array kNames = {"scene",          "pair",         "iterations",
                                        "initial_cost",   "final_cost",   "cf_sdf_checked",
                                        "cf_exact_dense", "cpu_us_total", "cpu_us_optimise"};

  std::size_t count_ = 0;
  std::array<std::size_t, kNames.size()> at_{};
};

RecordedRun read_run(const JsonEntry& run, const Columns& columns, int scenes, int pairs) {
  run.expect_keys(
      {"label", "field", "rel_tol", "max_iter", "results", "optimizer", "reps_min_taken"});
  RecordedRun read;
  read.label = run["label"].text();
  const std::string field = run["field"].text();
  read.is_signed = field == "sdf";
  if (!read.is_signed && field != "usdf") {
    run["field"].complain("expected \"sdf\" or \"usdf\", found \"" + field + "\"");
  }
  read.relative_tolerance = run["rel_tol"].number();
  if (!(read.relative_tolerance >= 0.0 && read.relative_tolerance <= 1.0)) {
    run["rel_tol"].complain("expected a number from 0 to 1");
  }
  read.max_iterations = run["max_iter"].integer(1, kMostCounted);
  for (const JsonEntry& row : run["results"].items()) {
    read.outcomes.push_back(columns.read(row, scenes, pairs));
  }
  return read;
}

void read_configurations(const JsonEntry& root, RecordedProblems& problems) {
  const JsonEntry configurations = root["configurations"];
  const std::size_t dof = configurations.at(0).size();
  if (dof == 0) configurations.at(0).complain("a configuration needs at least one number");
  for (const JsonEntry& configuration : configurations.items()) {
    problems.configurations.push_back(configuration.numbers(dof));
  }
  const int last = static_cast<int>(problems.configurations.size()) - 1;
  for (const JsonEntry& pair : root["pairs"].items()) {
    (void)pair.numbers(2);
    problems.pairs.emplace_back(pair.at(0).integer(0, last), pair.at(1).integer(0, last));
  }
}

}  // namespace

Result<RecordedProblems> read_recorded_problems(const std::filesystem::path& file) {
  auto json = SIDESTEP_TRY(JsonEntry::read(file.string()));
  const JsonEntry root(json);
  root.expect_keys({"configurations", "grid", "meta", "pairs", "result_columns", "robot", "runs",
                    "scenes", "settings"});
  RecordedProblems problems;
  problems.file = file;
  problems.grid = read_grid(root["grid"]);
  problems.first_node_m = root["grid"]["origin"].vector3();
  for (const JsonEntry& scene : root["scenes"].items()) {
    problems.scenes.push_back(read_scene(scene));
  }
  read_configurations(root, problems);
  problems.settings = read_settings(root["settings"]);
  if (json.error) return tl::make_unexpected(std::move(*json.error));

  const int dof = static_cast<int>(problems.configurations.front().size());
  auto robot = read_recorded_robot(root["robot"], dof);
  if (json.error) return tl::make_unexpected(std::move(*json.error));
  if (!robot) {
    return tl::make_unexpected(robot.error().wrapped(ErrorCode::kConfig, "there is no such robot",
                                                     file.string() + ": robot"));
  }
  problems.robot = std::move(robot->model);
  problems.has_base = robot->has_base;

  const Columns columns(root["result_columns"]);
  if (json.error) return tl::make_unexpected(std::move(*json.error));
  for (const JsonEntry& run : root["runs"].items()) {
    problems.runs.push_back(read_run(run, columns, static_cast<int>(problems.scenes.size()),
                                     static_cast<int>(problems.pairs.size())));
  }
  if (json.error) return tl::make_unexpected(std::move(*json.error));
  return problems;
}

}  // namespace sidestep
