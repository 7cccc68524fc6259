// A robot with kinematics of its own: joints x, y and raise, the angle of its arms to the ground.
// Links: the base, each stage, the platform.

#include "scissor_lift.hpp"

#include <cmath>
#include <string>

namespace scissor_lift {

using namespace sidestep;

Parameters<Options> Options::parameters() {
  return Parameters<Options>()
      .add("arm_m", &Options::arm_m, "Length of an arm, as long as the base is high.",
           {.unit = "m", .min = 0.01})
      .add("stages", &Options::stages, "Pairs of arms one above the other.", {.min = 1, .max = 10})
      .add("load_radius_m", &Options::load_radius_m,
           "Of a ball about the middle of the platform that holds it and its load.",
           {.unit = "m", .min = 0.01})
      .add("range_m", &Options::range_m, "How far x and y go to either side.",
           {.unit = "m", .min = 0.01})
      .add("max_velocity_mps", &Options::max_velocity_mps,
           "Largest speed of x and y, and of the ends of an arm.", {.unit = "m/s", .min = 1e-3})
      .add("max_acceleration_mps2", &Options::max_acceleration_mps2, "Likewise.",
           {.unit = "m/s^2", .min = 1e-3});
}

std::vector<OptionMistake> Options::check() const {
  if (load_radius_m >= 0.5 * arm_m) return {};
  return {
      {{"load_radius_m", "arm_m"}, "must be half of arm_m at least: it holds the platform", {}}};
}

ScissorLift::ScissorLift(const Options& options) : arm_m_(options.arm_m) {
  const double most = options.max_velocity_mps, hardest = options.max_acceleration_mps2;
  description_.name = "scissor_lift";
  description_.joints = {
      {"x", Joint::Type::kPrismatic, -options.range_m, options.range_m, most, hardest},
      {"y", Joint::Type::kPrismatic, -options.range_m, options.range_m, most, hardest},
      {"raise", Joint::Type::kRevolute, 0.1, 1.3, most / arm_m_, hardest / arm_m_}};
  // Spheres are all that planners see of a robot: they have to hold everything, at every q.
  const auto add = [&](std::string name, double stages_below, double radius_m, double above_m) {
    const int link = static_cast<int>(description_.links.size());
    description_.links.push_back({std::move(name), link - 1});
    stages_below_.push_back(stages_below);
    const Eigen::Vector3d centre_m(0.0, 0.0, above_m);
    description_.spheres.push_back({link, centre_m, radius_m});
    description_.shapes.push_back(
        {link, Sphere{radius_m}, Transform(Eigen::Translation3d(centre_m))});
  };
  add("base", 0.0, 0.5 * arm_m_, 0.5 * arm_m_);
  for (int i = 0; i < options.stages; ++i) {
    add("stage_" + std::to_string(i + 1), i + 0.5, 0.5 * arm_m_, 0.0);
  }
  add("platform", options.stages, options.load_radius_m, 0.0);
}

Eigen::Vector3d ScissorLift::origin_m(const double* q, int link) const {
  if (link == 0) return {q[0], q[1], 0.0};
  const double below = stages_below_[static_cast<std::size_t>(link)];
  return {q[0], q[1], arm_m_ * (1.0 + below * std::sin(q[2]))};
}

double ScissorLift::rise(const double* q, int link) const {
  return arm_m_ * stages_below_[static_cast<std::size_t>(link)] * std::cos(q[2]);
}

void ScissorLift::link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                             Scratch&) const {
  for (std::size_t i = 0; i < T_world_link.size(); ++i) {
    T_world_link[i] = Transform(Eigen::Translation3d(origin_m(q.data(), static_cast<int>(i))));
  }
}

// All that follows is of a batch: row after row of q, and for each all the spheres.

void ScissorLift::sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                                 Scratch&) const {
  const std::size_t spheres = description_.spheres.size();
  for (std::size_t i = 0; i < centres_m.size(); ++i) {
    const auto& [link, centre_link_m, radius_m] = description_.spheres[i % spheres];
    centres_m[i] = origin_m(&q[3 * (i / spheres)], link) + centre_link_m;
  }
}

void ScissorLift::sphere_jacobians(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                                   std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const {
  sphere_centres(q, centres_m, scratch);
  const std::size_t spheres = description_.spheres.size();
  for (std::size_t i = 0; i < centres_m.size(); ++i) {
    const int link = description_.spheres[i % spheres].link;
    jacobians[3 * i] = Eigen::Vector3d::UnitX();
    jacobians[3 * i + 1] = Eigen::Vector3d::UnitY();
    jacobians[3 * i + 2] = {0.0, 0.0, rise(&q[3 * (i / spheres)], link)};
  }
}

void ScissorLift::pull_back(std::span<const double> q, std::span<const LinkForce> forces,
                            std::span<double> joint_forces, Scratch&) const {
  for (std::size_t k = 0; k < forces.size(); ++k) {
    const auto& [row, link, force, moment] = forces[k];  // nothing turns: moments do no work
    joint_forces[3 * k] = force.x();
    joint_forces[3 * k + 1] = force.y();
    joint_forces[3 * k + 2] = rise(&q[3 * static_cast<std::size_t>(row)], link) * force.z();
  }
}

Result<std::unique_ptr<RobotModel>> create(const Options& options, const HostContext&) {
  return std::make_unique<ScissorLift>(options);
}

}  // namespace scissor_lift

SIDESTEP_PLUGIN(sidestep::RobotModel, scissor_lift::Options, scissor_lift::create, "scissor_lift",
                "0.1.0", "Crossed arms lift a platform: an example of a plugin")
