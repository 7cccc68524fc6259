#include "rosbag_source.hpp"

#include <Eigen/SVD>

namespace sidestep::rosbag {
namespace {

constexpr std::size_t kMatrixValues = 16;
/// How far a written rotation may be from orthonormal, element by element of R^T R - I.
constexpr double kRotationTolerance = 1e-2;

Eigen::Matrix4d matrix_of(const CalibrationStep& step) {
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(step.matrix.data());
}

std::string mistake_in(const CalibrationStep& step) {
  if (step.matrix.empty()) return {};
  if (!step.xyz_m.isZero(0.0) || !step.rpy_rad.isZero(0.0)) {
    return "excludes xyz_m and rpy_rad";
  }
  if (step.matrix.size() != kMatrixValues) {
    return "has " + std::to_string(step.matrix.size()) + " values, expected 16, row by row";
  }
  const Eigen::Matrix4d matrix = matrix_of(step);
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const Eigen::Matrix3d off = rotation.transpose() * rotation - Eigen::Matrix3d::Identity();
  const bool is_rigid = off.cwiseAbs().maxCoeff() <= kRotationTolerance &&
                        rotation.determinant() > 0.0 &&
                        matrix.row(3) == Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0);
  return is_rigid ? "" : "is no rigid transform";
}

Transform transform_of(const CalibrationStep& step) {
  Transform transform = transform_from_xyz_rpy(step.xyz_m, step.rpy_rad);
  if (!step.matrix.empty()) {
    const Eigen::Matrix4d matrix = matrix_of(step);
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix.topLeftCorner<3, 3>(),
                                                Eigen::ComputeFullU | Eigen::ComputeFullV);
    transform.linear() = svd.matrixU() * svd.matrixV().transpose();
    transform.translation() = matrix.topRightCorner<3, 1>();
  }
  return step.inverse ? transform.inverse() : transform;
}

void check_steps(const std::vector<CalibrationStep>& steps, const std::string& name,
                 std::vector<OptionMistake>& mistakes) {
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (const std::string what = mistake_in(steps[i]); !what.empty()) {
      mistakes.push_back({{name + "[" + std::to_string(i) + "].matrix"}, what, {}});
    }
  }
}

}  // namespace

Transform product(const std::vector<CalibrationStep>& steps) {
  Transform all = Transform::Identity();
  for (const CalibrationStep& step : steps) all = all * transform_of(step);
  return all;
}

Parameters<CameraOptions> CameraOptions::parameters() {
  using C = CameraOptions;
  return Parameters<C>()
      .add("fx_px", &C::fx_px, "Focal length along x; null: the camera info's.",
           {.unit = "px", .min = 1e-3})
      .add("fy_px", &C::fy_px, "Focal length along y; null: the camera info's.",
           {.unit = "px", .min = 1e-3})
      .add("cx_px", &C::cx_px, "Column of the principal point; null: the camera info's.",
           {.unit = "px"})
      .add("cy_px", &C::cy_px, "Row of the principal point; null: the camera info's.",
           {.unit = "px"});
}

Parameters<CalibrationStep> CalibrationStep::parameters() {
  using S = CalibrationStep;
  return Parameters<S>()
      .add("matrix", &S::matrix, "A 4x4 matrix, row by row; empty: of xyz_m and rpy_rad.")
      .add("xyz_m", &S::xyz_m, "Translation.", {.unit = "m"})
      .add("rpy_rad", &S::rpy_rad, "Fixed-axis roll, pitch and yaw.", {.unit = "rad"})
      .add("inverse", &S::inverse, "Whether its inverse is meant.");
}

Parameters<PoseOptions> PoseOptions::parameters() {
  using P = PoseOptions;
  return Parameters<P>()
      .add("from", &P::from,
           "tf: the tree of frames; topic: messages that tell a body's pose in a reference frame.",
           {.choices = {"tf", "topic"}})
      .add("tf_topics", &P::tf_topics, "Topics of tf/tfMessage or tf2_msgs/TFMessage.")
      .add("tf_static_topics", &P::tf_static_topics,
           "Topics of transforms that hold for all times.")
      .add("world_frame", &P::world_frame, "tf: the frame that is the map's world.")
      .add("camera_frame", &P::camera_frame,
           "tf: the camera's frame; null: what each message's header says.")
      .add("topic", &P::topic,
           "topic: of geometry_msgs/TransformStamped, geometry_msgs/PoseStamped or "
           "nav_msgs/Odometry.")
      .add("inverse", &P::inverse, "topic: whether its messages tell the reference in the body.")
      .add("T_world_reference", &P::T_world_reference,
           "A product of transforms before what the bag tells; empty: none.")
      .add("T_body_camera", &P::T_body_camera,
           "A product of transforms behind what the bag tells, the calibration; empty: none.")
      .add("max_gap_s", &P::max_gap_s, "Longest time between two poses that are interpolated.",
           {.unit = "s", .min = 0.0})
      .add("offset_s", &P::offset_s,
           "Added to a frame's stamp when poses and joints are looked up, where the camera's clock "
           "differs from theirs.",
           {.unit = "s"});
}

Parameters<BaseOptions> BaseOptions::parameters() {
  using B = BaseOptions;
  return ros_messages::base_joint_parameters<B>()
      .add(
          "from", &B::from,
          "tf: the pose of a frame in pose.world_frame; odometry: a topic of nav_msgs/Odometry, in "
          "its frame, which tf places in the world; with pose.from topic, its frame is the "
          "reference.",
          {.choices = {"tf", "odometry"}})
      .add("frame", &B::frame, "tf: the base's frame.")
      .add("topic", &B::topic, "odometry: its topic.");
}

Parameters<FixedJoint> FixedJoint::parameters() {
  using F = FixedJoint;
  return Parameters<F>()
      .add("joint", &F::joint, "The robot's joint.", {.required = true})
      .add("position", &F::position, "Its position throughout, in m or rad.", {.required = true});
}

Parameters<JointOptions> JointOptions::parameters() {
  using J = JointOptions;
  return Parameters<J>()
      .add("topics", &J::topics, "Topics of sensor_msgs/JointState.")
      .add("max_gap_s", &J::max_gap_s,
           "Longest time between two positions, of a joint or the base, that are interpolated.",
           {.unit = "s", .min = 0.0})
      .add("base", &J::base, "Joints of a mobile base, by its pose.")
      .add("fixed", &J::fixed, "Joints that stay where they are, and no message tells of.");
}

Parameters<Options> Options::parameters() {
  using O = Options;
  return Parameters<O>()
      .add("path", &O::path, "The bag.", {.required = true})
      .add("topic", &O::topic,
           "Topic of the depth images (sensor_msgs/Image), clouds (sensor_msgs/PointCloud2) or "
           "scans of a laser (sensor_msgs/LaserScan).",
           {.required = true})
      .add("camera_info_topic", &O::camera_info_topic,
           "Topic of the images' sensor_msgs/CameraInfo; null: camera_info beside them.")
      .add("camera", &O::camera, "Intrinsics, where the camera info's do not apply.")
      .add("points_in", &O::points_in,
           "Axes of the clouds' frame; optical: z forward, y down; forward: x forward, z up.",
           {.choices = {"optical", "forward"}})
      .add("depth_min_m", &O::depth_min_m, "Nearer depths of images count as no measurement.",
           {.unit = "m", .min = 0.0})
      .add("depth_max_m", &O::depth_max_m, "Farther depths of images count as no measurement.",
           {.unit = "m", .min = 0.0})
      .add("stamps", &O::stamps,
           "When frames were taken; header: as their messages say; received: when they were "
           "recorded.",
           {.choices = {"header", "received"}})
      .add("pose", &O::pose, "Where the camera is.")
      .add("joints", &O::joints,
           "Where the run's robot stands, for mappers that remove its own points; null: not known.")
      .add("first_frame", &O::first_frame, "Frames left out at the beginning.", {.min = 0})
      .add("max_frames", &O::max_frames, "Frames handed out at most; 0: all.", {.min = 0})
      .add("stride", &O::stride, "Every how many frames one is handed out.", {.min = 1})
      .add("pace", &O::pace,
           "as_fast_as_possible: every frame, one after the other; clock: the newest that is due "
           "on the run's clock, stamped with it.",
           {.choices = {"as_fast_as_possible", "clock"}})
      .add("rate", &O::rate, "clock: seconds of the recording in a second of the run.",
           {.min = 1e-3});
}

std::vector<OptionMistake> Options::check() const {
  std::vector<OptionMistake> mistakes;
  if (depth_min_m >= depth_max_m) {
    mistakes.push_back({{"depth_min_m", "depth_max_m"}, "must be less than depth_max_m", {}});
  }
  if (pose.from == "topic" && !pose.topic) {
    mistakes.push_back({{"pose.from"}, "is topic, but pose.topic is not set", {}});
  }
  if (pose.from == "tf" && pose.topic) {
    mistakes.push_back({{"pose.topic"}, "is set, but pose.from is tf", "set pose.from to topic"});
  }
  if (pose.from == "tf" && pose.inverse) {
    mistakes.push_back({{"pose.inverse"}, "is set, but pose.from is tf", {}});
  }
  if (joints && joints->base) {
    const bool needs_topic = joints->base->from == "odometry";
    if (needs_topic && !joints->base->topic) {
      mistakes.push_back(
          {{"joints.base.from"}, "is odometry, but joints.base.topic is not set", {}});
    }
    if (!needs_topic && pose.from != "tf") {
      mistakes.push_back({{"joints.base.from"}, "is tf, but pose.from is not", {}});
    }
  }
  check_steps(pose.T_world_reference, "pose.T_world_reference", mistakes);
  check_steps(pose.T_body_camera, "pose.T_body_camera", mistakes);
  return mistakes;
}

}  // namespace sidestep::rosbag
