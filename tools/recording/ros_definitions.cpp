#include "ros_messages.hpp"

// The public definitions of ROS's common messages (std_msgs 0.5, geometry_msgs, sensor_msgs,
// trajectory_msgs and visualization_msgs 1.13, tf2_msgs 0.7; BSD), without their comments, which
// count for nothing in the sums.

namespace sidestep::ros {
namespace {

// Each after the line that begins it in a definition that contains it.
// clang-format off
#define SIDESTEP_MSG(name) \
  "\n" \
  "================================================================================\n" \
  "MSG: " name "\n"

#define SIDESTEP_HEADER \
  SIDESTEP_MSG("std_msgs/Header") \
  "uint32 seq\n" \
  "time stamp\n" \
  "string frame_id\n"

#define SIDESTEP_REGION_OF_INTEREST \
  SIDESTEP_MSG("sensor_msgs/RegionOfInterest") \
  "uint32 x_offset\n" \
  "uint32 y_offset\n" \
  "uint32 height\n" \
  "uint32 width\n" \
  "bool do_rectify\n"

#define SIDESTEP_POINT_FIELD \
  SIDESTEP_MSG("sensor_msgs/PointField") \
  "uint8 INT8 = 1\n" \
  "uint8 UINT8 = 2\n" \
  "uint8 INT16 = 3\n" \
  "uint8 UINT16 = 4\n" \
  "uint8 INT32 = 5\n" \
  "uint8 UINT32 = 6\n" \
  "uint8 FLOAT32 = 7\n" \
  "uint8 FLOAT64 = 8\n" \
  "string name\n" \
  "uint32 offset\n" \
  "uint8 datatype\n" \
  "uint32 count\n"

#define SIDESTEP_TRANSFORM_STAMPED \
  SIDESTEP_MSG("geometry_msgs/TransformStamped") \
  "Header header\n" \
  "string child_frame_id\n" \
  "Transform transform\n"

#define SIDESTEP_TRANSFORM \
  SIDESTEP_MSG("geometry_msgs/Transform") \
  "Vector3 translation\n" \
  "Quaternion rotation\n"

#define SIDESTEP_VECTOR3 \
  SIDESTEP_MSG("geometry_msgs/Vector3") \
  "float64 x\n" \
  "float64 y\n" \
  "float64 z\n"

#define SIDESTEP_QUATERNION \
  SIDESTEP_MSG("geometry_msgs/Quaternion") \
  "float64 x\n" \
  "float64 y\n" \
  "float64 z\n" \
  "float64 w\n"

#define SIDESTEP_MARKER \
  SIDESTEP_MSG("visualization_msgs/Marker") \
  "uint8 ARROW=0\n" \
  "uint8 CUBE=1\n" \
  "uint8 SPHERE=2\n" \
  "uint8 CYLINDER=3\n" \
  "uint8 LINE_STRIP=4\n" \
  "uint8 LINE_LIST=5\n" \
  "uint8 CUBE_LIST=6\n" \
  "uint8 SPHERE_LIST=7\n" \
  "uint8 POINTS=8\n" \
  "uint8 TEXT_VIEW_FACING=9\n" \
  "uint8 MESH_RESOURCE=10\n" \
  "uint8 TRIANGLE_LIST=11\n" \
  "uint8 ADD=0\n" \
  "uint8 MODIFY=0\n" \
  "uint8 DELETE=2\n" \
  "uint8 DELETEALL=3\n" \
  "Header header\n" \
  "string ns\n" \
  "int32 id\n" \
  "int32 type\n" \
  "int32 action\n" \
  "geometry_msgs/Pose pose\n" \
  "geometry_msgs/Vector3 scale\n" \
  "std_msgs/ColorRGBA color\n" \
  "duration lifetime\n" \
  "bool frame_locked\n" \
  "geometry_msgs/Point[] points\n" \
  "std_msgs/ColorRGBA[] colors\n" \
  "string text\n" \
  "string mesh_resource\n" \
  "bool mesh_use_embedded_materials\n"

#define SIDESTEP_POSE \
  SIDESTEP_MSG("geometry_msgs/Pose") \
  "Point position\n" \
  "Quaternion orientation\n"

#define SIDESTEP_POINT \
  SIDESTEP_MSG("geometry_msgs/Point") \
  "float64 x\n" \
  "float64 y\n" \
  "float64 z\n"

#define SIDESTEP_COLOR_RGBA \
  SIDESTEP_MSG("std_msgs/ColorRGBA") \
  "float32 r\n" \
  "float32 g\n" \
  "float32 b\n" \
  "float32 a\n"

#define SIDESTEP_JOINT_TRAJECTORY_POINT \
  SIDESTEP_MSG("trajectory_msgs/JointTrajectoryPoint") \
  "float64[] positions\n" \
  "float64[] velocities\n" \
  "float64[] accelerations\n" \
  "float64[] effort\n" \
  "duration time_from_start\n"

#define SIDESTEP_MULTI_ARRAY_LAYOUT \
  SIDESTEP_MSG("std_msgs/MultiArrayLayout") \
  "MultiArrayDimension[] dim\n" \
  "uint32 data_offset\n"

#define SIDESTEP_MULTI_ARRAY_DIMENSION \
  SIDESTEP_MSG("std_msgs/MultiArrayDimension") \
  "string label\n" \
  "uint32 size\n" \
  "uint32 stride\n"

constexpr MessageType kImage{
  "sensor_msgs/Image",
  "060021388200f6f0f447d0fcd9c64743",
  "Header header\n"
  "uint32 height\n"
  "uint32 width\n"
  "string encoding\n"
  "uint8 is_bigendian\n"
  "uint32 step\n"
  "uint8[] data\n"
  SIDESTEP_HEADER};

constexpr MessageType kCameraInfo{
  "sensor_msgs/CameraInfo",
  "c9a58c1b0b154e0e6da7578cb991d214",
  "Header header\n"
  "uint32 height\n"
  "uint32 width\n"
  "string distortion_model\n"
  "float64[] D\n"
  "float64[9] K\n"
  "float64[9] R\n"
  "float64[12] P\n"
  "uint32 binning_x\n"
  "uint32 binning_y\n"
  "RegionOfInterest roi\n"
  SIDESTEP_HEADER
  SIDESTEP_REGION_OF_INTEREST};

constexpr MessageType kPointCloud2{
  "sensor_msgs/PointCloud2",
  "1158d486dd51d683ce2f1be655c3c181",
  "Header header\n"
  "uint32 height\n"
  "uint32 width\n"
  "PointField[] fields\n"
  "bool is_bigendian\n"
  "uint32 point_step\n"
  "uint32 row_step\n"
  "uint8[] data\n"
  "bool is_dense\n"
  SIDESTEP_HEADER
  SIDESTEP_POINT_FIELD};

constexpr MessageType kTFMessage{
  "tf2_msgs/TFMessage",
  "94810edda583a504dfda3829e70d7eec",
  "geometry_msgs/TransformStamped[] transforms\n"
  SIDESTEP_TRANSFORM_STAMPED
  SIDESTEP_HEADER
  SIDESTEP_TRANSFORM
  SIDESTEP_VECTOR3
  SIDESTEP_QUATERNION};

constexpr MessageType kJointState{
  "sensor_msgs/JointState",
  "3066dcd76a6cfaef579bd0f34173e9fd",
  "Header header\n"
  "string[] name\n"
  "float64[] position\n"
  "float64[] velocity\n"
  "float64[] effort\n"
  SIDESTEP_HEADER};

constexpr MessageType kMarkerArray{
  "visualization_msgs/MarkerArray",
  "d155b9ce5188fbaf89745847fd5882d7",
  "Marker[] markers\n"
  SIDESTEP_MARKER
  SIDESTEP_HEADER
  SIDESTEP_POSE
  SIDESTEP_POINT
  SIDESTEP_QUATERNION
  SIDESTEP_VECTOR3
  SIDESTEP_COLOR_RGBA};

constexpr MessageType kJointTrajectory{
  "trajectory_msgs/JointTrajectory",
  "65b4f94a94d1ed67169da35a02f33d3f",
  "Header header\n"
  "string[] joint_names\n"
  "JointTrajectoryPoint[] points\n"
  SIDESTEP_HEADER
  SIDESTEP_JOINT_TRAJECTORY_POINT};

constexpr MessageType kString{
  "std_msgs/String",
  "992ce8a1687cec8c8bd883ec73ca41d1",
  "string data\n"};

constexpr MessageType kUInt8MultiArray{
  "std_msgs/UInt8MultiArray",
  "82373f1612381bb6ee473b5cd6f5d89c",
  "MultiArrayLayout layout\n"
  "uint8[] data\n"
  SIDESTEP_MULTI_ARRAY_LAYOUT
  SIDESTEP_MULTI_ARRAY_DIMENSION};

// clang-format on

}  // namespace

template <>
const MessageType& type_of<Image>() noexcept {
  return kImage;
}
template <>
const MessageType& type_of<CameraInfo>() noexcept {
  return kCameraInfo;
}
template <>
const MessageType& type_of<PointCloud2>() noexcept {
  return kPointCloud2;
}
template <>
const MessageType& type_of<TFMessage>() noexcept {
  return kTFMessage;
}
template <>
const MessageType& type_of<JointState>() noexcept {
  return kJointState;
}
template <>
const MessageType& type_of<MarkerArray>() noexcept {
  return kMarkerArray;
}
template <>
const MessageType& type_of<JointTrajectory>() noexcept {
  return kJointTrajectory;
}
template <>
const MessageType& type_of<String>() noexcept {
  return kString;
}
template <>
const MessageType& type_of<UInt8MultiArray>() noexcept {
  return kUInt8MultiArray;
}

}  // namespace sidestep::ros
