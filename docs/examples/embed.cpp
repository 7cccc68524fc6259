// From a depth image to a motion that is proven clear, without an experiment: a camera at the HSR's
// start, a metre above the floor, sees a pillar 1.5 m ahead, and the robot is to go three metres.
#include <cstdio>
#include <cstdlib>

#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/runtime/motion_planning.hpp>
#include <sidestep/runtime/session.hpp>
#include <sidestep/runtime/standing_floor.hpp>
using namespace sidestep;

template <class T>
T need(Result<T> result) {
  if (!result) std::exit((std::fprintf(stderr, "%s\n", result.error().describe().c_str()), 1));
  if constexpr (!std::is_void_v<T>) return std::move(*result);
}

Frame pillar_ahead() {
  DepthImage image{{640, 480, 525.0, 525.0, 319.5, 239.5}, std::vector<float>(640 * 480, 4.2f)};
  for (std::size_t i = 0; i < image.depth_m.size(); ++i) {
    if (i % 640 > 260 && i % 640 < 380) image.depth_m[i] = 1.5f;
  }
  Frame frame{.measurement = std::move(image)};
  frame.T_world_camera.translation() = Eigen::Vector3d(0.0, 0.0, 1.0);
  frame.T_world_camera.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;  // z of an optical frame is ahead
  return frame;
}

int main() {
  Session session;
  const std::shared_ptr<const RobotModel> robot =
      need(session.create<RobotModel>("{plugin: urdf, profile: hsr}"));
  auto mapper = need(session.create<Mapper>(
      "{plugin: voxel_grid, resolution_m: 0.05, size_vox: [99, 99, 40], origin_m: [-1, -2.5, 0]}"));
  auto fields = need(session.create<FieldBuilder>("{plugin: edt, unknown: free}"));
  auto optimiser = need(session.create<Optimiser>("{plugin: gp_chain}"));
  need(fields->attach(*mapper));
  const auto field = need(fields->update(need(mapper->integrate(pillar_ahead()))));

  PlanningSettings planning;
  planning.unknown = "free";
  stand_on_floor(planning, *robot);
  const RobotDescription& about = robot->description();
  Eigen::VectorXd start = Eigen::VectorXd::Zero(about.dof());
  for (int j = 0; j < about.dof(); ++j) start[j] = about.find_pose("go")->positions[j].value_or(0);
  Eigen::VectorXd goal = start;
  goal[*about.joint_index("odom_x")] = 3.0;
  const Problem problem = make_problem(robot, field, planning, start, goal);
  const MotionLimits limits = planning.limits(about);
  const auto check = make_field_check(robot, field, planning.space(), {.margin_m = 0.045});
  PlannedMotion motion{.failure = "not tried yet"};
  for (int attempt = 0; attempt < 5 && !motion.failure.empty(); ++attempt) {
    motion = need(plan_motion(optimiser, problem, initial_guess(problem, attempt, 0),
                              {&limits, check.get()}, Deadline::after_s(5.0)));
    std::puts(motion.failure.empty() ? motion.verdict->describe().c_str() : motion.failure.c_str());
  }
  return motion.failure.empty() ? EXIT_SUCCESS : EXIT_FAILURE;
}
