#include "ros_messages.hpp"

#include <bit>
#include <concepts>
#include <cstring>
#include <tuple>
#include <type_traits>

namespace sidestep::ros {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");

template <class T>
concept Number = std::is_arithmetic_v<T> || std::is_same_v<T, std::byte>;

// The fields of every message, in order: for writing and for reading.

template <class T, class Message>
concept Either = std::same_as<std::remove_const_t<T>, Message>;

auto fields(Either<Time> auto& m) { return std::tie(m.sec, m.nsec); }
auto fields(Either<Duration> auto& m) { return std::tie(m.sec, m.nsec); }
auto fields(Either<Header> auto& m) { return std::tie(m.seq, m.stamp, m.frame_id); }
auto fields(Either<Vector3> auto& m) { return std::tie(m.x, m.y, m.z); }
auto fields(Either<Point> auto& m) { return std::tie(m.x, m.y, m.z); }
auto fields(Either<Quaternion> auto& m) { return std::tie(m.x, m.y, m.z, m.w); }
auto fields(Either<Transform> auto& m) { return std::tie(m.translation, m.rotation); }
auto fields(Either<Pose> auto& m) { return std::tie(m.position, m.orientation); }
auto fields(Either<ColorRGBA> auto& m) { return std::tie(m.r, m.g, m.b, m.a); }
auto fields(Either<Image> auto& m) {
  return std::tie(m.header, m.height, m.width, m.encoding, m.is_bigendian, m.step, m.data);
}
auto fields(Either<RegionOfInterest> auto& m) {
  return std::tie(m.x_offset, m.y_offset, m.height, m.width, m.do_rectify);
}
auto fields(Either<CameraInfo> auto& m) {
  return std::tie(m.header, m.height, m.width, m.distortion_model, m.D, m.K, m.R, m.P, m.binning_x,
                  m.binning_y, m.roi);
}
auto fields(Either<PointField> auto& m) { return std::tie(m.name, m.offset, m.datatype, m.count); }
auto fields(Either<PointCloud2> auto& m) {
  return std::tie(m.header, m.height, m.width, m.fields, m.is_bigendian, m.point_step, m.row_step,
                  m.data, m.is_dense);
}
auto fields(Either<TransformStamped> auto& m) {
  return std::tie(m.header, m.child_frame_id, m.transform);
}
auto fields(Either<TFMessage> auto& m) { return std::tie(m.transforms); }
auto fields(Either<JointState> auto& m) {
  return std::tie(m.header, m.name, m.position, m.velocity, m.effort);
}
auto fields(Either<Marker> auto& m) {
  return std::tie(m.header, m.ns, m.id, m.type, m.action, m.pose, m.scale, m.color, m.lifetime,
                  m.frame_locked, m.points, m.colors, m.text, m.mesh_resource,
                  m.mesh_use_embedded_materials);
}
auto fields(Either<MarkerArray> auto& m) { return std::tie(m.markers); }
auto fields(Either<JointTrajectoryPoint> auto& m) {
  return std::tie(m.positions, m.velocities, m.accelerations, m.effort, m.time_from_start);
}
auto fields(Either<JointTrajectory> auto& m) { return std::tie(m.header, m.joint_names, m.points); }
auto fields(Either<String> auto& m) { return std::tie(m.data); }
auto fields(Either<MultiArrayDimension> auto& m) { return std::tie(m.label, m.size, m.stride); }
auto fields(Either<MultiArrayLayout> auto& m) { return std::tie(m.dim, m.data_offset); }
auto fields(Either<UInt8MultiArray> auto& m) { return std::tie(m.layout, m.data); }

/// Appends fields to bytes.
class Encoder {
 public:
  explicit Encoder(std::vector<std::byte>& bytes) : bytes_(bytes) {}

  void operator()(const auto&... values) { (value(values), ...); }

 private:
  void raw(const void* data, std::size_t size) {
    const std::size_t before = bytes_.size();
    bytes_.resize(before + size);
    if (size > 0) std::memcpy(bytes_.data() + before, data, size);
  }
  void length(std::size_t count) { value(static_cast<std::uint32_t>(count)); }

  template <Number T>
  void value(const T& number) {
    raw(&number, sizeof number);
  }
  void value(const std::string& text) {
    length(text.size());
    raw(text.data(), text.size());
  }
  template <Number T, std::size_t n>
  void value(const std::array<T, n>& numbers) {
    raw(numbers.data(), sizeof numbers);
  }
  template <class T>
  void value(const std::vector<T>& list) {
    length(list.size());
    if constexpr (Number<T>) {
      raw(list.data(), list.size() * sizeof(T));
    } else {
      for (const T& item : list) value(item);
    }
  }
  template <class Message>
  requires std::is_class_v<Message>
  void value(const Message& message) { std::apply(*this, fields(message)); }

  std::vector<std::byte>& bytes_;
};

/// Takes fields from bytes; once these do not suffice, it leaves all further ones as they are.
class Decoder {
 public:
  explicit Decoder(std::span<const std::byte> bytes) : left_(bytes) {}

  void operator()(auto&... values) { (value(values), ...); }

  /// Whether all fields were there and nothing is left.
  [[nodiscard]] bool is_done() const noexcept { return is_whole_ && left_.empty(); }

 private:
  void raw(void* data, std::size_t size) {
    is_whole_ = is_whole_ && size <= left_.size();
    if (!is_whole_ || size == 0) return;
    std::memcpy(data, left_.data(), size);
    left_ = left_.subspan(size);
  }
  /// Of what takes at least `item_bytes` each; 0 where there cannot be so many.
  std::size_t length(std::size_t item_bytes) {
    std::uint32_t count = 0;
    value(count);
    is_whole_ = is_whole_ && count <= left_.size() / item_bytes;
    return is_whole_ ? count : 0;
  }

  template <Number T>
  void value(T& number) {
    raw(&number, sizeof number);
  }
  void value(std::string& text) {
    text.resize(length(1));
    raw(text.data(), text.size());
  }
  template <Number T, std::size_t n>
  void value(std::array<T, n>& numbers) {
    raw(numbers.data(), sizeof numbers);
  }
  template <class T>
  void value(std::vector<T>& list) {
    if constexpr (Number<T>) {
      list.resize(length(sizeof(T)));
      raw(list.data(), list.size() * sizeof(T));
    } else {
      // Not made room for at once: a wrong length would cost memory.
      for (std::size_t left = length(1); left > 0 && is_whole_; --left) value(list.emplace_back());
    }
  }
  template <class Message>
  requires std::is_class_v<Message>
  void value(Message& message) { std::apply(*this, fields(message)); }

  std::span<const std::byte> left_;
  bool is_whole_ = true;
};

// The public definitions of ROS's common messages (std_msgs 0.5, geometry_msgs, sensor_msgs,
// trajectory_msgs and visualization_msgs 1.13, tf2_msgs 0.7; BSD), without their comments, which
// count for nothing in the sums.

template <class Message>
constexpr MessageType kType{};

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

template <>
constexpr MessageType kType<Image>{
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

template <>
constexpr MessageType kType<CameraInfo>{
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

template <>
constexpr MessageType kType<PointCloud2>{
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

template <>
constexpr MessageType kType<TFMessage>{
  "tf2_msgs/TFMessage",
  "94810edda583a504dfda3829e70d7eec",
  "geometry_msgs/TransformStamped[] transforms\n"
  SIDESTEP_TRANSFORM_STAMPED
  SIDESTEP_HEADER
  SIDESTEP_TRANSFORM
  SIDESTEP_VECTOR3
  SIDESTEP_QUATERNION};

template <>
constexpr MessageType kType<JointState>{
  "sensor_msgs/JointState",
  "3066dcd76a6cfaef579bd0f34173e9fd",
  "Header header\n"
  "string[] name\n"
  "float64[] position\n"
  "float64[] velocity\n"
  "float64[] effort\n"
  SIDESTEP_HEADER};

template <>
constexpr MessageType kType<MarkerArray>{
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

template <>
constexpr MessageType kType<JointTrajectory>{
  "trajectory_msgs/JointTrajectory",
  "65b4f94a94d1ed67169da35a02f33d3f",
  "Header header\n"
  "string[] joint_names\n"
  "JointTrajectoryPoint[] points\n"
  SIDESTEP_HEADER
  SIDESTEP_JOINT_TRAJECTORY_POINT};

template <>
constexpr MessageType kType<String>{
  "std_msgs/String",
  "992ce8a1687cec8c8bd883ec73ca41d1",
  "string data\n"};

template <>
constexpr MessageType kType<UInt8MultiArray>{
  "std_msgs/UInt8MultiArray",
  "82373f1612381bb6ee473b5cd6f5d89c",
  "MultiArrayLayout layout\n"
  "uint8[] data\n"
  SIDESTEP_MULTI_ARRAY_LAYOUT
  SIDESTEP_MULTI_ARRAY_DIMENSION};

// clang-format on

}  // namespace

template <class Message>
const MessageType& type_of() noexcept {
  return kType<Message>;
}

template <class Message>
void serialise(const Message& message, std::vector<std::byte>& bytes) {
  Encoder encode(bytes);
  encode(message);
}

template <class Message>
Result<Message> parse(std::span<const std::byte> bytes) {
  Message message;
  Decoder decode(bytes);
  decode(message);
  if (decode.is_done()) return message;
  return fail(ErrorCode::kIo, "the message is no " + std::string(type_of<Message>().name) +
                                  ": its " + std::to_string(bytes.size()) +
                                  " bytes do not fit the fields");
}

#define SIDESTEP_ROS_MESSAGE(Message)                                        \
  template const MessageType& type_of<Message>() noexcept;                   \
  template void serialise<Message>(const Message&, std::vector<std::byte>&); \
  template Result<Message> parse<Message>(std::span<const std::byte>)
SIDESTEP_ROS_MESSAGE(Image);
SIDESTEP_ROS_MESSAGE(CameraInfo);
SIDESTEP_ROS_MESSAGE(PointCloud2);
SIDESTEP_ROS_MESSAGE(TFMessage);
SIDESTEP_ROS_MESSAGE(JointState);
SIDESTEP_ROS_MESSAGE(MarkerArray);
SIDESTEP_ROS_MESSAGE(JointTrajectory);
SIDESTEP_ROS_MESSAGE(String);
SIDESTEP_ROS_MESSAGE(UInt8MultiArray);
#undef SIDESTEP_ROS_MESSAGE

}  // namespace sidestep::ros
