#pragma once

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

#include "support/sampled_field.hpp"

/// Problems recorded together with what GPMP2 made of them (shared data, gpmp2/README.md).
namespace sidestep::testing_support {

[[nodiscard]] inline std::filesystem::path gpmp2_folder() {
  return std::filesystem::path(SIDESTEP_SHARED_DATA) / "gpmp2";
}

[[nodiscard]] inline nlohmann::json read_json(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) throw std::runtime_error("cannot read " + file.string());
  return nlohmann::json::parse(stream);
}

[[nodiscard]] inline Eigen::Vector3d vector3(const nlohmann::json& values) {
  return {values.at(0).get<double>(), values.at(1).get<double>(), values.at(2).get<double>()};
}

[[nodiscard]] inline Eigen::VectorXd vector(const nlohmann::json& values) {
  const auto numbers = values.get<std::vector<double>>();
  return Eigen::Map<const Eigen::VectorXd>(numbers.data(),
                                           static_cast<Eigen::Index>(numbers.size()));
}

/// The recorded problems know no velocity limits.
inline constexpr double kNoLimit = 1e6;

/// A serial arm from its Denavit-Hartenberg table, in either convention.
[[nodiscard]] inline std::shared_ptr<const RobotModel> dh_arm(const nlohmann::json& robot) {
  const bool modified = robot.at("dh").get<std::string>().starts_with("modified");
  const std::size_t joints = robot.at("a").size();
  RobotDescription description;
  description.name = robot.at("name");
  description.links.push_back({"base", -1});
  std::vector<TreeJoint> tree(1);
  std::vector<Transform> after(joints, Transform::Identity());  // from joint i to frame i
  for (std::size_t i = 0; i < joints; ++i) {
    Transform twist = Transform::Identity();
    twist.rotate(Eigen::AngleAxisd(robot["alpha"][i].get<double>(), Eigen::Vector3d::UnitX()));
    const Eigen::Vector3d along(robot["a"][i].get<double>(), 0.0, 0.0);
    const Eigen::Vector3d up(0.0, 0.0, robot["d"][i].get<double>());
    TreeJoint joint;
    joint.name = "joint_" + std::to_string(i + 1);
    joint.motion = TreeJoint::Motion::kRotation;
    joint.joint = static_cast<int>(i);
    joint.offset = robot["theta_bias"][i];
    if (modified) {
      joint.T_parent_joint = twist * Eigen::Translation3d(along) * Eigen::Translation3d(up);
    } else {
      if (i > 0) joint.T_parent_joint = after[i - 1];
      after[i] = Eigen::Translation3d(up + along) * twist;
    }
    tree.push_back(joint);
    description.links.push_back({"link_" + std::to_string(i + 1), static_cast<int>(i)});
    const double unlimited = std::numeric_limits<double>::infinity();
    description.joints.push_back(
        {joint.name, Joint::Type::kContinuous, -unlimited, unlimited, kNoLimit, unlimited});
  }
  for (const auto& sphere : robot.at("spheres")) {
    const std::size_t frame = sphere.at(0);
    const Eigen::Vector3d centre(sphere.at(1).get<double>(), sphere.at(2).get<double>(),
                                 sphere.at(3).get<double>());
    description.spheres.push_back(
        {static_cast<int>(frame) + 1, after[frame] * centre, sphere.at(4)});
  }
  auto arm = KinematicTree::create(std::move(description), std::move(tree));
  if (!arm) throw std::runtime_error(arm.error().describe());
  return std::move(*arm);
}

/// Squared distances in voxels to the nearest voxel that is `set`, exact, one axis at a time.
[[nodiscard]] inline std::vector<double> squared_distances(const GridSpec& grid,
                                                           const std::vector<bool>& set) {
  std::vector<double> squared(set.size());
  for (std::size_t v = 0; v < set.size(); ++v) {
    squared[v] = set[v] ? 0.0 : std::numeric_limits<double>::infinity();
  }
  for (int axis = 0; axis < 3; ++axis) {
    const int n = grid.size_vox[axis];
    Eigen::Vector3i lines = grid.size_vox;
    lines[axis] = 1;
    const std::size_t step = grid.linear(Eigen::Vector3i::Unit(axis));
    std::vector<double> line(static_cast<std::size_t>(n));
    for (int l = 0; l < lines.prod(); ++l) {
      const Eigen::Vector3i first(l % lines.x(), l / lines.x() % lines.y(),
                                  l / (lines.x() * lines.y()));
      double* at = &squared[grid.linear(first)];
      for (int i = 0; i < n; ++i)
        line[static_cast<std::size_t>(i)] = at[step * static_cast<std::size_t>(i)];
      for (int i = 0; i < n; ++i) {
        double least = std::numeric_limits<double>::infinity();
        for (int j = 0; j < n; ++j) {
          least = std::min(least, line[static_cast<std::size_t>(j)] + (i - j) * (i - j));
        }
        at[step * static_cast<std::size_t>(i)] = least;
      }
    }
  }
  return squared;
}

/// The field of a scene of boxes as the recording defines it.
[[nodiscard]] inline std::shared_ptr<const DistanceField> gpmp2_field(const nlohmann::json& file,
                                                                      int scene, bool is_signed) {
  const double cell = file["grid"]["cell"];
  GridSpec grid;
  grid.resolution_m = cell;
  grid.origin_m = vector3(file["grid"]["origin"]).array() - 0.5 * cell;  // nodes are our centres
  grid.size_vox = vector3(file["grid"]["n"]).cast<int>();
  std::vector<bool> occupied(grid.voxel_count()), free(grid.voxel_count());
  const auto each_voxel = [&](auto&& visit) {
    for (int k = 0; k < grid.size_vox.z(); ++k) {
      for (int j = 0; j < grid.size_vox.y(); ++j) {
        for (int i = 0; i < grid.size_vox.x(); ++i) visit(Eigen::Vector3i(i, j, k));
      }
    }
  };
  each_voxel([&](const Eigen::Vector3i& voxel) {
    const Eigen::Array3d node =
        vector3(file["grid"]["origin"]).array() + cell * voxel.cast<double>().array();
    for (const auto& box : file["scenes"][static_cast<std::size_t>(scene)]) {
      if ((node > vector3(box["lo"]).array() - 0.5 * cell).all() &&
          (node < vector3(box["hi"]).array() + 0.5 * cell).all()) {
        occupied[grid.linear(voxel)] = true;
      }
    }
    free[grid.linear(voxel)] = !occupied[grid.linear(voxel)];
  });
  const auto to_occupied = squared_distances(grid, occupied);
  const auto to_free = squared_distances(grid, free);
  return sampled_field(grid, [&](const Eigen::Vector3d& centre) {
    const Eigen::Vector3i voxel = grid.voxel_at(centre);
    if (!grid.contains(voxel)) return 0.0;
    const std::size_t v = grid.linear(voxel);
    if (std::isinf(to_occupied[v])) return 1000.0;
    return cell * (std::sqrt(to_occupied[v]) - (is_signed ? std::sqrt(to_free[v]) : 0.0));
  });
}

/// A recorded problem, with the cost terms of GPMP2.
[[nodiscard]] inline Problem gpmp2_problem(const nlohmann::json& file,
                                           std::shared_ptr<const RobotModel> robot,
                                           std::shared_ptr<const DistanceField> field, int pair) {
  const nlohmann::json& settings = file["settings"];
  const auto& ends = file["pairs"][static_cast<std::size_t>(pair)];
  Problem problem;
  problem.robot = std::move(robot);
  problem.field = std::move(field);
  problem.space = {Space::kFree, Space::kFree};
  const auto state = [&](std::size_t end) {
    const Eigen::VectorXd q = vector(file["configurations"][ends.at(end).get<std::size_t>()]);
    return RobotState{q, Eigen::VectorXd::Zero(q.size())};
  };
  problem.start = state(0);
  problem.goal = state(1);
  problem.support_states = settings["states"];
  problem.dt_s = settings["total_time_s"].get<double>() / settings["total_step"].get<double>();
  problem.qc = Eigen::VectorXd::Constant(problem.start.q.size(), settings["Qc_diag"].get<double>());
  problem.interpolated_checks = settings["obs_check_inter"];
  const double sigma = settings["conf_prior_sigma"];
  problem.terms = {{make_state_prior("start", problem.start, sigma), Placement::kStart},
                   {make_state_prior("goal", problem.goal, sigma), Placement::kGoal},
                   {make_obstacle_cost(problem.robot, problem.field, problem.space,
                                       settings["epsilon"], settings["cost_sigma"]),
                    Placement::kSupportAndInterpolated}};
  return problem;
}

/// GPMP2's straight line, whose velocities are per step and ignore the ends at rest.
[[nodiscard]] inline Trajectory gpmp2_initial(const Problem& problem) {
  Trajectory out = straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
  const Eigen::VectorXd step = (problem.goal.q - problem.start.q) / (problem.support_states - 1);
  for (int i = 0; i < out.size(); ++i) std::copy_n(step.data(), step.size(), out.qdot(i).begin());
  return out;
}

}  // namespace sidestep::testing_support
