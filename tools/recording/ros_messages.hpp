#pragma once

#include <array>
#include <bit>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>

/// The ROS 1 messages that recordings hold: the fields of their public definitions, in order and by
/// name, as plain data.
namespace sidestep::ros {

/// Whole seconds and the nanoseconds beyond them. 0 means "no time" to ROS.
struct Time {
  std::uint32_t sec = 0;
  std::uint32_t nsec = 0;
  friend constexpr auto operator<=>(const Time&, const Time&) = default;
};
struct Duration {
  std::int32_t sec = 0;
  std::int32_t nsec = 0;
  friend bool operator==(const Duration&, const Duration&) = default;
};

struct Header {
  std::uint32_t seq = 0;
  Time stamp;
  std::string frame_id;
};

struct Vector3 {
  double x = 0.0, y = 0.0, z = 0.0;
};
struct Point {
  double x = 0.0, y = 0.0, z = 0.0;
};
struct Quaternion {
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;
};
struct Transform {
  Vector3 translation;
  Quaternion rotation;
};
struct Pose {
  Point position;
  Quaternion orientation;
};
struct ColorRGBA {
  float r = 0.0F, g = 0.0F, b = 0.0F, a = 1.0F;
};

struct Image {
  Header header;
  std::uint32_t height = 0, width = 0;
  std::string encoding;  ///< "16UC1": mm; "32FC1": m.
  std::uint8_t is_bigendian = 0;
  std::uint32_t step = 0;  ///< Bytes of a row.
  std::vector<std::byte> data;
};

struct RegionOfInterest {
  std::uint32_t x_offset = 0, y_offset = 0, height = 0, width = 0;
  std::uint8_t do_rectify = 0;
};
struct CameraInfo {
  Header header;
  std::uint32_t height = 0, width = 0;
  std::string distortion_model;
  std::vector<double> D;
  std::array<double, 9> K{};
  std::array<double, 9> R{};
  std::array<double, 12> P{};
  std::uint32_t binning_x = 0, binning_y = 0;
  RegionOfInterest roi;
};

struct PointField {
  static constexpr std::uint8_t kFloat32 = 7;
  std::string name;
  std::uint32_t offset = 0;
  std::uint8_t datatype = kFloat32;
  std::uint32_t count = 1;
};
struct PointCloud2 {
  Header header;
  std::uint32_t height = 0, width = 0;
  std::vector<PointField> fields;
  std::uint8_t is_bigendian = 0;
  std::uint32_t point_step = 0, row_step = 0;
  std::vector<std::byte> data;
  std::uint8_t is_dense = 0;
};

struct TransformStamped {
  Header header;
  std::string child_frame_id;
  Transform transform;
};
struct TFMessage {
  std::vector<TransformStamped> transforms;
};

struct JointState {
  Header header;
  std::vector<std::string> name;
  std::vector<double> position, velocity, effort;
};

struct Marker {
  enum Type : std::int32_t {
    kCube = 1,
    kSphere = 2,
    kCylinder = 3,
    kLineStrip = 4,
    kCubeList = 6,
    kTriangleList = 11,
  };
  enum Action : std::int32_t { kAdd = 0, kDeleteAll = 3 };

  Header header;
  std::string ns;
  std::int32_t id = 0;
  std::int32_t type = 0;
  std::int32_t action = kAdd;
  Pose pose;
  Vector3 scale;
  ColorRGBA color;
  Duration lifetime;  ///< 0: for ever.
  std::uint8_t frame_locked = 0;
  std::vector<Point> points;
  std::vector<ColorRGBA> colors;
  std::string text;
  std::string mesh_resource;
  std::uint8_t mesh_use_embedded_materials = 0;
};
struct MarkerArray {
  std::vector<Marker> markers;
};

struct JointTrajectoryPoint {
  std::vector<double> positions, velocities, accelerations, effort;
  Duration time_from_start;
};
struct JointTrajectory {
  Header header;
  std::vector<std::string> joint_names;
  std::vector<JointTrajectoryPoint> points;
};

struct String {
  std::string data;
};

struct MultiArrayDimension {
  std::string label;
  std::uint32_t size = 0, stride = 0;
};
struct MultiArrayLayout {
  std::vector<MultiArrayDimension> dim;
  std::uint32_t data_offset = 0;
};
struct UInt8MultiArray {
  MultiArrayLayout layout;
  std::vector<std::byte> data;
};

/// What ROS knows a message by.
struct MessageType {
  std::string_view name;        ///< "package/Type"
  std::string_view md5sum;      ///< Of the definition, by ROS's rule.
  std::string_view definition;  ///< With those of all messages in it.
};

/// The type of each message that a recording holds as a whole. [any]
template <class Message>
[[nodiscard]] const MessageType& type_of() noexcept;

/// Appends a message as ROS writes it: little-endian, without padding; strings and lists after
/// their length, 32 bits. [any]
template <class Message>
void serialise(const Message& message, std::vector<std::byte>& bytes);

/// The message that these bytes are, no more and no fewer; fails with kIo where they are none.
/// [any]
template <class Message>
[[nodiscard]] Result<Message> parse(std::span<const std::byte> bytes);

}  // namespace sidestep::ros
