// Robots and trajectories.
#include <array>

#include <sidestep/robot/robot_model.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/trajectory/write_trajectory.hpp>

#include "bindings.hpp"

namespace sidestep::python {
namespace {

RobotPtr make_robot(const SessionPtr& session, const py::object& value) {
  py::object block = value;
  if (py::isinstance<py::str>(value) || py::hasattr(value, "__fspath__")) {
    py::dict profile;
    profile["plugin"] = "urdf";
    profile["profile"] = value;
    block = profile;
  }
  const Node node = node_of(block, "robot");
  return unlocked("robot", [&]() -> Result<RobotPtr> {
    return RobotPtr(kept_with(SIDESTEP_TRY(session->host().create<RobotModel>(node)), session));
  });
}

/// n x dof values, or dof of them.
Doubles batch_of(const Doubles& q, const RobotModel& robot) {
  const int dof = robot.description().dof();
  if (q.ndim() == 1 && q.shape(0) == dof) return q.attr("reshape")(1, dof);
  (void)rows_of(q, dof, "configurations");
  return q;
}

std::span<const double> span_of(const Doubles& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}

Scratch& scratch() {
  thread_local Scratch own;
  return own;
}

py::array_t<double> link_poses(const RobotModel& robot, const Doubles& q) {
  const int dof = robot.description().dof();
  if (q.ndim() != 1 || q.shape(0) != dof) {
    throw py::value_error("a configuration has " + std::to_string(dof) + " values");
  }
  std::vector<Transform> poses(robot.description().links.size());
  robot.link_poses(span_of(q), poses, scratch());
  py::array_t<double> result(
      {static_cast<py::ssize_t>(poses.size()), py::ssize_t{4}, py::ssize_t{4}});
  double* into = result.mutable_data();
  for (const Transform& pose : poses) {
    Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> rows_of_pose(into);
    rows_of_pose = pose.matrix();
    into += 16;
  }
  return result;
}

py::array_t<double> sphere_centres(const RobotModel& robot, const Doubles& q) {
  const Doubles batch = batch_of(q, robot);
  const auto count = robot.description().spheres.size();
  py::array_t<double> result({batch.shape(0), static_cast<py::ssize_t>(count), py::ssize_t{3}});
  static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
  const std::span centres(reinterpret_cast<Eigen::Vector3d*>(result.mutable_data()),
                          static_cast<std::size_t>(batch.shape(0)) * count);
  const Unlocked release;
  robot.sphere_centres(span_of(batch), centres, scratch());
  return result;
}

py::dict named_pose(const RobotModel& robot, const std::string& name) {
  const RobotDescription& about = robot.description();
  const NamedPose* pose = about.find_pose(name);
  if (pose == nullptr) {
    raise(unknown_name("robot '" + about.name + "' has no pose", name, {}, names_of(about.poses)));
  }
  py::dict joints;
  for (std::size_t j = 0; j < about.joints.size(); ++j) {
    if (pose->positions[j]) joints[py::str(about.joints[j].name)] = *pose->positions[j];
  }
  return joints;
}

Trajectory make_motion(const Doubles& times_s, const Doubles& positions,
                       const Doubles& velocities) {
  if (times_s.ndim() != 1) throw py::value_error("times_s are to be one array of n");
  if (positions.ndim() != 2) throw py::value_error("positions are to be n x joints");
  const auto dof = positions.shape(1);
  if (rows_of(positions, dof, "positions") != times_s.shape(0) ||
      rows_of(velocities, dof, "velocities") != times_s.shape(0)) {
    throw py::value_error("times_s, positions and velocities are to have as many rows each");
  }
  const auto copied = [](const Doubles& array) {
    return std::vector<double>(array.data(), array.data() + array.size());
  };
  Trajectory trajectory{static_cast<int>(dof), copied(times_s), copied(positions),
                        copied(velocities)};
  need(trajectory.validate());
  return trajectory;
}

std::pair<py::array_t<double>, py::array_t<double>> sample(const Trajectory& trajectory,
                                                           const Doubles& times_s) {
  if (times_s.ndim() > 1) throw py::value_error("times_s are to be a number, or one array of n");
  const auto n = times_s.size();
  const auto dof = static_cast<std::size_t>(trajectory.dof);
  const std::vector<py::ssize_t> shape = times_s.ndim() == 0
                                             ? std::vector<py::ssize_t>{trajectory.dof}
                                             : std::vector<py::ssize_t>{n, trajectory.dof};
  py::array_t<double> q(shape), qdot(shape);
  for (py::ssize_t i = 0; i < n; ++i) {
    const auto offset = static_cast<std::size_t>(i) * dof;
    trajectory.sample(times_s.data()[i], {q.mutable_data() + offset, dof},
                      {qdot.mutable_data() + offset, dof});
  }
  return {q, qdot};
}

template <std::vector<double> Trajectory::*kValues>
py::array rows(const py::object& self) {
  const auto& trajectory = self.cast<const Trajectory&>();
  return view_of<double>({trajectory.size(), trajectory.dof}, (trajectory.*kValues).data(), self);
}

}  // namespace

void bind_robots(py::module_& module, py::class_<Session, SessionPtr>& session) {
  py::class_<Joint>(module, "Joint", "One planned degree of freedom; m or rad.")
      .def_readonly("name", &Joint::name, "By which states and files name it.")
      .def_readonly("lower", &Joint::lower,
                    "Least position, in `unit`; -inf of a continuous joint.")
      .def_readonly("upper", &Joint::upper,
                    "Largest position, in `unit`; inf of a continuous joint.")
      .def_readonly("max_velocity", &Joint::max_velocity, "In `unit` per second.")
      .def_readonly("max_acceleration", &Joint::max_acceleration,
                    "In `unit` per second squared; inf where it is not known.")
      .def_property_readonly("unit", &Joint::unit,
                             "Of its positions: \"m\" of a sliding joint, \"rad\" of a turning "
                             "one.");

  py::class_<RobotModel, std::shared_ptr<RobotModel>>(
      module, "Robot", "A robot's kinematics and shapes. Configurations are in order of `joints`.")
      .def_property_readonly(
          "name", [](const RobotModel& r) { return r.description().name; }, "The robot's name.")
      .def_property_readonly(
          "dof", [](const RobotModel& r) { return r.description().dof(); },
          "How many joints are planned: values of a configuration.")
      .def_property_readonly(
          "joints", [](const RobotModel& r) { return r.description().joints; },
          "A list of Joint, in order of a configuration's values.")
      .def_property_readonly(
          "links", [](const RobotModel& r) { return names_of(r.description().links); },
          "Names, parents before children.")
      .def_property_readonly(
          "poses", [](const RobotModel& r) { return names_of(r.description().poses); },
          "Names of its poses.")
      .def_property_readonly(
          "sphere_radii_m",
          [](const RobotModel& r) {
            py::array_t<double> radii(static_cast<py::ssize_t>(r.description().spheres.size()));
            double* into = radii.mutable_data();
            for (const CollisionSphere& sphere : r.description().spheres) *into++ = sphere.radius_m;
            return radii;
          },
          "Of its collision spheres, in m, in order of sphere_centres().")
      .def("pose", &named_pose, py::arg("name"), "The joints that a named pose sets, by name.")
      .def(
          "configuration",
          [](const RobotModel& r, const py::object& value) {
            return configuration_of(value, r.description(), "configuration");
          },
          py::arg("value"),
          "dof values, in m or rad, of a pose's name or of {\"pose\": ..., \"joints\": {...}}.")
      .def("link_poses", &link_poses, py::arg("q"),
           "Of one configuration: links x 4 x 4, world frame, in order of `links`.")
      .def("sphere_centres", &sphere_centres, py::arg("q"),
           "Of one configuration or n: n x spheres x 3 in m, world frame.");

  py::class_<Trajectory>(
      module, "Trajectory",
      "States over time, joined by cubics. The arrays are views, which cannot be written.")
      .def(py::init(&make_motion), py::arg("times_s"), py::arg("positions"), py::arg("velocities"),
           "n times from 0, n x joints in m or rad, and the same per second.")
      .def_property_readonly(
          "times_s",
          [](const py::object& self) {
            const auto& trajectory = self.cast<const Trajectory&>();
            return view_of<double>({trajectory.size()}, trajectory.times_s.data(), self);
          },
          "n, ascending from 0, in s.")
      .def_property_readonly("positions", &rows<&Trajectory::positions>, "n x joints, m or rad.")
      .def_property_readonly("velocities", &rows<&Trajectory::velocities>,
                             "n x joints, m/s or rad/s.")
      .def_property_readonly("duration_s", &Trajectory::duration_s, "The last of times_s.")
      .def("__len__", &Trajectory::size)
      .def("sample", &sample, py::arg("times_s"),
           "Positions and velocities at one time or at n; held before 0 and after the end.")
      .def(
          "write",
          [](const Trajectory& trajectory, const std::filesystem::path& file,
             const RobotModel& robot) {
            unlocked("trajectory", [&] {
              return write_trajectory(trajectory, names_of(robot.description().joints), file);
            });
          },
          py::arg("file"), py::arg("robot"),
          "For other programs: `.csv`, with a column for each joint's position and velocity, or "
          "`.json`, MoveIt's RobotTrajectory. Folders on the way that are not there are made, as "
          "`sidestep run` makes those of its trajectories; a file of that name is replaced.");

  session.def("robot", &make_robot, py::arg("robot"),
              "A profile by its name (\"hsr\") or file, or a block.");
}

}  // namespace sidestep::python
