#include <limits>

#include <sidestep/plugin/plugin.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace {

using namespace sidestep;

struct Options {
  double radius_m = 0.2;
  double height_m = 0.3;
  std::vector<double> lower_m{-10.0, -10.0};
  std::vector<double> upper_m{10.0, 10.0};
  double max_velocity_mps = 1.0;
  std::optional<double> max_acceleration_mps2;
  std::optional<double> max_braking_mps2;

  static Parameters<Options> parameters() {
    return Parameters<Options>()
        .add("radius_m", &Options::radius_m, "Radius of the ball.", {.unit = "m", .min = 1e-6})
        .add("height_m", &Options::height_m, "Height of its centre above z = 0.", {.unit = "m"})
        .add("lower_m", &Options::lower_m, "Lowest x and y.", {.unit = "m"})
        .add("upper_m", &Options::upper_m, "Highest x and y.", {.unit = "m"})
        .add("max_velocity_mps", &Options::max_velocity_mps, "Largest speed along x and along y.",
             {.unit = "m/s", .min = 1e-6})
        .add("max_acceleration_mps2", &Options::max_acceleration_mps2,
             "Largest acceleration along x and along y; none if absent.",
             {.unit = "m/s^2", .min = 1e-6})
        .add("max_braking_mps2", &Options::max_braking_mps2,
             "Largest deceleration along x and along y where it is to stop; "
             "'max_acceleration_mps2' if absent.",
             {.unit = "m/s^2", .min = 1e-6});
  }
  [[nodiscard]] std::vector<OptionMistake> check() const {
    std::vector<OptionMistake> mistakes;
    for (const auto& [name, limits] :
         {std::pair("lower_m", &lower_m), std::pair("upper_m", &upper_m)}) {
      if (limits->size() != 2) mistakes.push_back({{name}, "needs two numbers: x and y", {}});
    }
    if (max_braking_mps2 && !max_acceleration_mps2) {
      mistakes.push_back({{"max_braking_mps2"},
                          "stands without 'max_acceleration_mps2'",
                          "say how hard motions may brake, too"});
    } else if (max_braking_mps2 && *max_braking_mps2 < *max_acceleration_mps2) {
      mistakes.push_back({{"max_braking_mps2"},
                          "must not be below 'max_acceleration_mps2'",
                          "stops brake at least as hard as motions"});
    }
    if (!mistakes.empty()) return mistakes;
    for (std::size_t i = 0; i < 2; ++i) {
      if (lower_m[i] <= upper_m[i]) continue;
      mistakes.push_back({{"lower_m[" + std::to_string(i) + "]", "upper_m"},
                          "must not be above upper_m[" + std::to_string(i) + "]",
                          {}});
    }
    return mistakes;
  }
};

Result<std::unique_ptr<RobotModel>> create(const Options& options, const HostContext&) {
  RobotDescription robot;
  robot.name = "point";
  robot.links = {{"world", -1}, {"slide", 0}, {"body", 1}};
  std::vector<TreeJoint> joints(3);
  joints[0].name = "root";
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string name = i == 0 ? "x" : "y";
    robot.joints.push_back(
        {name, Joint::Type::kPrismatic, options.lower_m[i], options.upper_m[i],
         options.max_velocity_mps,
         options.max_acceleration_mps2.value_or(std::numeric_limits<double>::infinity()),
         options.max_braking_mps2});
    TreeJoint& joint = joints[i + 1];
    joint.name = name;
    joint.motion = TreeJoint::Motion::kTranslation;
    joint.axis = Eigen::Vector3d::Unit(static_cast<int>(i));
    joint.joint = static_cast<int>(i);
  }
  robot.spheres = {{2, {0.0, 0.0, options.height_m}, options.radius_m}};
  Transform T_body_ball = Transform::Identity();
  T_body_ball.translate(Eigen::Vector3d(0.0, 0.0, options.height_m));
  robot.shapes = {{2, Sphere{options.radius_m}, T_body_ball}};
  auto tree = KinematicTree::create(std::move(robot), std::move(joints));
  if (!tree)
    return tl::make_unexpected(tree.error().wrapped(
        ErrorCode::kConfig, "the robot does not fit together", "plugin point"));
  return std::unique_ptr<RobotModel>(std::move(*tree));
}

}  // namespace

SIDESTEP_PLUGIN(sidestep::RobotModel, Options, create, "point", "0.1.0",
                "A ball that moves in the plane, for 2D navigation")
