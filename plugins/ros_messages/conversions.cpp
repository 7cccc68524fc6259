#include "conversions.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "byte_order.hpp"

namespace sidestep::ros_messages {
namespace {

/// Projection matrices are 3 x 4, row by row; P is all zero where the camera is not calibrated.
constexpr std::size_t kPfx = 0, kPcx = 2, kPfy = 5, kPcy = 6;
constexpr std::size_t kKfx = 0, kKcx = 2, kKfy = 4, kKcy = 5;
constexpr double kLargest_px = 65536.0;

constexpr float kInvalid = std::numeric_limits<float>::quiet_NaN();
constexpr double kMillimetresPerMetre = 1000.0;
constexpr std::uint16_t kRawNothing = 0;
constexpr std::uint16_t kRawInvalid = 65535;

std::string size_text(std::size_t width, std::size_t height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

struct MillimetrePixel {
  using Raw = std::uint16_t;
  static float metres(Raw raw, const DepthRange& range) {
    if (raw == kRawInvalid) return kInvalid;
    const double metres = raw / kMillimetresPerMetre;
    const bool is_measured = raw != kRawNothing && metres >= range.min_m && metres <= range.max_m;
    return is_measured ? static_cast<float>(metres) : 0.0F;
  }
};

struct MetrePixel {
  using Raw = std::uint32_t;
  static float metres(Raw raw, const DepthRange& range) {
    const auto metres = std::bit_cast<float>(raw);
    if (!(metres >= 0.0F)) return kInvalid;  // NaN, -inf and what lies behind the camera
    return metres >= range.min_m && metres <= range.max_m ? metres : 0.0F;
  }
};

/// The message has the bytes that its size and step ask for.
template <class Pixel>
std::vector<float> read_pixels(const Image& message, const DepthRange& range) {
  const bool swapped = is_foreign(message.is_bigendian != 0);
  std::vector<float> depth_m(static_cast<std::size_t>(message.width) * message.height);
  for (std::size_t v = 0; v < message.height; ++v) {
    const std::uint8_t* const row = message.data.data() + v * message.step;
    float* const out = depth_m.data() + v * message.width;
    for (std::size_t u = 0; u < message.width; ++u) {
      const auto raw =
          read_raw<typename Pixel::Raw>(row + u * sizeof(typename Pixel::Raw), swapped);
      out[u] = Pixel::metres(raw, range);
    }
  }
  return depth_m;
}

Result<void> check_bytes(const Image& message, std::size_t bytes_per_pixel) {
  const std::size_t row = message.width * bytes_per_pixel;
  if (message.step < row) {
    return bad_message("a row of the image has " + std::to_string(message.step) +
                       " bytes, its pixels need " + std::to_string(row));
  }
  const std::size_t needed = static_cast<std::size_t>(message.height - 1) * message.step + row;
  if (message.data.size() < needed) {
    return bad_message("the image has " + std::to_string(message.data.size()) +
                       " bytes, its size says " + std::to_string(needed));
  }
  return {};
}

template <class Raw>
void write_pixels(const std::vector<Raw>& values, Image& message) {
  message.data.resize(values.size() * sizeof(Raw));
  std::memcpy(message.data.data(), values.data(), message.data.size());
  message.step = static_cast<std::uint32_t>(message.width * sizeof(Raw));
}

std::uint16_t millimetres(float depth_m) {
  if (std::isnan(depth_m)) return kRawInvalid;
  const double raw = std::round(static_cast<double>(depth_m) * kMillimetresPerMetre);
  return raw > 0.0 && raw < kRawInvalid ? static_cast<std::uint16_t>(raw) : kRawNothing;
}

struct Coordinate {
  std::size_t offset = 0;
  bool is_double = false;

  [[nodiscard]] std::size_t end() const { return offset + (is_double ? 8 : 4); }
  [[nodiscard]] float read(const std::uint8_t* point, bool swapped) const {
    if (!is_double) return std::bit_cast<float>(read_raw<std::uint32_t>(point + offset, swapped));
    return static_cast<float>(
        std::bit_cast<double>(read_raw<std::uint64_t>(point + offset, swapped)));
  }
};

Result<Coordinate> find_coordinate(const PointCloud2& message, const char* name) {
  const auto field = std::ranges::find_if(
      message.fields, [&](const PointField& candidate) { return candidate.name == name; });
  if (field == message.fields.end())
    return bad_message(std::string("the cloud has no field ") + name);
  const bool is_double = field->datatype == PointField::FLOAT64;
  if (!is_double && field->datatype != PointField::FLOAT32) {
    return bad_message(std::string("the cloud's field ") + name + " is no floating-point number");
  }
  const Coordinate coordinate{field->offset, is_double};
  if (coordinate.end() > message.point_step) {
    return bad_message(std::string("the cloud's field ") + name + " lies beyond the " +
                       std::to_string(message.point_step) + " bytes of a point");
  }
  return coordinate;
}

Result<void> check_cloud_bytes(const PointCloud2& message) {
  const std::size_t row = static_cast<std::size_t>(message.width) * message.point_step;
  if (message.height > 1 && message.row_step < row) {
    return bad_message("a row of the cloud has " + std::to_string(message.row_step) +
                       " bytes, its points need " + std::to_string(row));
  }
  if (message.width == 0 || message.height == 0) return {};
  const std::size_t needed = static_cast<std::size_t>(message.height - 1) * message.row_step + row;
  if (message.data.size() < needed) {
    return bad_message("the cloud has " + std::to_string(message.data.size()) +
                       " bytes, its size says " + std::to_string(needed));
  }
  return {};
}

constexpr std::int64_t kSecond_ns = 1'000'000'000;

/// Of a geometry_msgs Transform's or Pose's parts.
template <class Position, class Orientation>
std::optional<RigidPose> pose_from(const Position& p, const Orientation& q) {
  return rigid_pose({p.x, p.y, p.z}, {q.w, q.x, q.y, q.z});
}

}  // namespace

bool is_distorted(const CameraInfo& info) {
  const bool has_projection = info.P[kPfx] > 0.0;
  return !has_projection && std::ranges::any_of(info.D, [](double d) { return d != 0.0; });
}

Result<CameraIntrinsics> intrinsics(const CameraInfo& info) {
  const bool has_projection = info.P[kPfx] > 0.0;
  CameraIntrinsics camera;
  camera.fx_px = has_projection ? info.P[kPfx] : info.K[kKfx];
  camera.fy_px = has_projection ? info.P[kPfy] : info.K[kKfy];
  camera.cx_px = has_projection ? info.P[kPcx] : info.K[kKcx];
  camera.cy_px = has_projection ? info.P[kPcy] : info.K[kKcy];
  // The matrices are those of the full image; a region of 0 x 0 is the full image.
  const auto& roi = info.roi;
  const double binning_x = std::max(1U, info.binning_x);
  const double binning_y = std::max(1U, info.binning_y);
  const double width = std::floor((roi.width > 0 ? roi.width : info.width) / binning_x);
  const double height = std::floor((roi.height > 0 ? roi.height : info.height) / binning_y);
  camera.fx_px /= binning_x;
  camera.fy_px /= binning_y;
  camera.cx_px = (camera.cx_px - roi.x_offset) / binning_x;
  camera.cy_px = (camera.cy_px - roi.y_offset) / binning_y;
  const bool is_usable = width > 0.0 && width <= kLargest_px && height > 0.0 &&
                         height <= kLargest_px && camera.fx_px > 0.0 && camera.fy_px > 0.0 &&
                         std::isfinite(camera.fx_px) && std::isfinite(camera.fy_px) &&
                         std::isfinite(camera.cx_px) && std::isfinite(camera.cy_px);
  if (!is_usable) {
    return fail(ErrorCode::kBadFrame,
                "the camera info holds no intrinsics: its size or focal length is not positive");
  }
  camera.width_px = static_cast<int>(width);
  camera.height_px = static_cast<int>(height);
  return camera;
}

CameraInfo to_camera_info(const CameraIntrinsics& camera, Stamp stamp, const std::string& frame) {
  CameraInfo info;
  info.header.stamp = to_ros_time(stamp);
  info.header.frame_id = frame;
  info.width = static_cast<std::uint32_t>(camera.width_px);
  info.height = static_cast<std::uint32_t>(camera.height_px);
  info.distortion_model = "plumb_bob";
  info.D.resize(5);
  info.K[kKfx] = info.P[kPfx] = camera.fx_px;
  info.K[kKfy] = info.P[kPfy] = camera.fy_px;
  info.K[kKcx] = info.P[kPcx] = camera.cx_px;
  info.K[kKcy] = info.P[kPcy] = camera.cy_px;
  info.K[8] = info.P[10] = 1.0;
  info.R[0] = info.R[4] = info.R[8] = 1.0;
  return info;
}

Result<DepthImage> depth_image(const Image& message, const CameraIntrinsics& camera,
                               const DepthRange& range) {
  const bool in_millimetres = message.encoding == "16UC1" || message.encoding == "mono16";
  if (!in_millimetres && message.encoding != "32FC1") {
    return bad_message(
        "the image's encoding is '" + message.encoding + "', expected 16UC1 or 32FC1",
        "name the topic of the depth image");
  }
  if (message.width == 0 || message.height == 0 ||
      !std::cmp_equal(message.width, camera.width_px) ||
      !std::cmp_equal(message.height, camera.height_px)) {
    return bad_message("the image has " + size_text(message.width, message.height) +
                       " pixels, the camera's have " + std::to_string(camera.width_px) + " x " +
                       std::to_string(camera.height_px));
  }
  SIDESTEP_TRY(check_bytes(message, in_millimetres ? 2 : 4));
  return DepthImage{camera, in_millimetres ? read_pixels<MillimetrePixel>(message, range)
                                           : read_pixels<MetrePixel>(message, range)};
}

Image to_image(const DepthImage& image, DepthEncoding encoding, Stamp stamp,
               const std::string& frame) {
  Image message;
  message.header.stamp = to_ros_time(stamp);
  message.header.frame_id = frame;
  message.width = static_cast<std::uint32_t>(image.camera.width_px);
  message.height = static_cast<std::uint32_t>(image.camera.height_px);
  message.is_bigendian = std::endian::native == std::endian::big ? 1 : 0;
  if (encoding == DepthEncoding::k32FC1) {
    message.encoding = "32FC1";
    // What is no return, 0 here, is +inf there.
    std::vector<float> metres = image.depth_m;
    std::ranges::replace(metres, 0.0F, std::numeric_limits<float>::infinity());
    write_pixels(metres, message);
  } else {
    message.encoding = "16UC1";
    std::vector<std::uint16_t> raw(image.depth_m.size());
    std::ranges::transform(image.depth_m, raw.begin(), millimetres);
    write_pixels(raw, message);
  }
  return message;
}

Result<PointCloud> point_cloud(const PointCloud2& message) {
  std::array<Coordinate, 3> coordinates;
  for (std::size_t i = 0; i < coordinates.size(); ++i) {
    static constexpr std::array<const char*, 3> kNames{"x", "y", "z"};
    coordinates[i] = SIDESTEP_TRY(find_coordinate(message, kNames[i]));
  }
  SIDESTEP_TRY(check_cloud_bytes(message));
  const bool swapped = is_foreign(message.is_bigendian != 0);
  PointCloud cloud;
  if (message.width == 0) return cloud;
  // The product is at most the number of bytes, which was checked.
  cloud.points_m.reserve(static_cast<std::size_t>(message.width) * message.height);
  for (std::size_t v = 0; v < message.height; ++v) {
    const std::uint8_t* point = message.data.data() + v * message.row_step;
    for (std::size_t u = 0; u < message.width; ++u, point += message.point_step) {
      const Eigen::Vector3f p(coordinates[0].read(point, swapped),
                              coordinates[1].read(point, swapped),
                              coordinates[2].read(point, swapped));
      if (p.allFinite()) cloud.points_m.push_back(p);
    }
  }
  return cloud;
}

Result<PointCloud> laser_scan(const LaserScan& message) {
  if (!std::isfinite(message.angle_min) || !std::isfinite(message.angle_increment)) {
    return bad_message("the scan's angles are not finite");
  }
  PointCloud scan;
  scan.points_m.reserve(message.ranges.size());
  for (std::size_t i = 0; i < message.ranges.size(); ++i) {
    const float range_m = message.ranges[i];
    // False of NaN, too.
    const bool is_measured = range_m >= message.range_min && range_m <= message.range_max;
    const float angle_rad = message.angle_min + static_cast<float>(i) * message.angle_increment;
    const float nan = std::numeric_limits<float>::quiet_NaN();
    scan.points_m.push_back(is_measured ? Eigen::Vector3f(range_m * std::cos(angle_rad),
                                                          range_m * std::sin(angle_rad), 0.0F)
                                        : Eigen::Vector3f::Constant(nan));
  }
  return scan;
}

LaserScan to_laser_scan(const PointCloud& scan, double from_rad, double to_rad,
                        const DepthRange& range, Stamp stamp, const std::string& frame) {
  LaserScan message;
  message.header.stamp = to_ros_time(stamp);
  message.header.frame_id = frame;
  const auto steps = std::max<std::size_t>(scan.points_m.size(), 2) - 1;
  message.angle_min = static_cast<float>(from_rad);
  message.angle_max = static_cast<float>(to_rad);
  message.angle_increment = static_cast<float>((to_rad - from_rad) / static_cast<double>(steps));
  message.range_min = static_cast<float>(range.min_m);
  message.range_max = static_cast<float>(range.max_m);
  for (const Eigen::Vector3f& p : scan.points_m) {
    message.ranges.push_back(p.allFinite() ? p.norm() : std::numeric_limits<float>::infinity());
  }
  return message;
}

PointCloud2 to_point_cloud(const PointCloud& cloud, Stamp stamp, const std::string& frame) {
  PointCloud2 message;
  message.header.stamp = to_ros_time(stamp);
  message.header.frame_id = frame;
  message.height = 1;
  message.width = static_cast<std::uint32_t>(cloud.points_m.size());
  message.point_step = sizeof(Eigen::Vector3f);
  message.row_step = message.width * message.point_step;
  message.is_dense = 1;
  message.is_bigendian = std::endian::native == std::endian::big ? 1 : 0;
  for (std::size_t i = 0; i < 3; ++i) {
    PointField field;
    field.name = std::string(1, static_cast<char>('x' + i));
    field.offset = static_cast<std::uint32_t>(i * sizeof(float));
    field.datatype = PointField::FLOAT32;
    field.count = 1;
    message.fields.push_back(field);
  }
  message.data.resize(message.row_step);
  if (!cloud.points_m.empty()) {
    std::memcpy(message.data.data(), cloud.points_m.data(), message.data.size());
  }
  return message;
}

Stamp to_stamp(const ::ros::Time& time) noexcept {
  return Stamp{static_cast<std::int64_t>(time.sec) * kSecond_ns + time.nsec};
}

::ros::Time to_ros_time(Stamp stamp) {
  constexpr std::int64_t kLargest_ns = 0xffffffffLL * kSecond_ns;
  const std::int64_t ns = std::clamp<std::int64_t>(stamp.ns, 0, kLargest_ns);
  return {static_cast<std::uint32_t>(ns / kSecond_ns), static_cast<std::uint32_t>(ns % kSecond_ns)};
}

std::optional<RigidPose> pose_of(const TransformStamped& message) {
  return pose_from(message.transform.translation, message.transform.rotation);
}

std::optional<RigidPose> pose_of(const PoseStamped& message) {
  return pose_from(message.pose.position, message.pose.orientation);
}

std::optional<RigidPose> pose_of(const Odometry& message) {
  return pose_from(message.pose.pose.position, message.pose.pose.orientation);
}

int add_transforms(const TfMessage& message, bool is_static, TfTree& tree) {
  int unusable = 0;
  for (const TransformStamped& transform : message.transforms) {
    const auto pose = pose_of(transform);
    const std::string& parent = transform.header.frame_id;
    const bool is_added =
        pose && (is_static ? tree.add_static(parent, transform.child_frame_id, *pose)
                           : tree.add(parent, transform.child_frame_id,
                                      to_stamp(transform.header.stamp), *pose));
    unusable += is_added ? 0 : 1;
  }
  return unusable;
}

int add_joint_states(const JointState& message, JointHistory& history) {
  const Stamp stamp = to_stamp(message.header.stamp);
  int unusable = 0;
  for (std::size_t i = 0; i < message.name.size(); ++i) {
    const bool is_added =
        i < message.position.size() && history.add(message.name[i], stamp, message.position[i]);
    unusable += is_added ? 0 : 1;
  }
  return unusable;
}

TransformStamped to_transform(const RigidPose& T_parent_child, Stamp stamp,
                              const std::string& parent, const std::string& child) {
  TransformStamped message;
  message.header.stamp = to_ros_time(stamp);
  message.header.frame_id = parent;
  message.child_frame_id = child;
  message.transform.translation.x = T_parent_child.translation_m.x();
  message.transform.translation.y = T_parent_child.translation_m.y();
  message.transform.translation.z = T_parent_child.translation_m.z();
  message.transform.rotation.x = T_parent_child.rotation.x();
  message.transform.rotation.y = T_parent_child.rotation.y();
  message.transform.rotation.z = T_parent_child.rotation.z();
  message.transform.rotation.w = T_parent_child.rotation.w();
  return message;
}

JointState to_joint_state(std::span<const Joint> joints, std::span<const double> positions,
                          Stamp stamp) {
  JointState message;
  message.header.stamp = to_ros_time(stamp);
  for (const Joint& joint : joints) message.name.push_back(joint.name);
  message.position.assign(positions.begin(), positions.end());
  return message;
}

}  // namespace sidestep::ros_messages
