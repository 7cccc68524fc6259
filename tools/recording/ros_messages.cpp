#include "ros_messages.hpp"

#include <bit>
#include <cstring>
#include <type_traits>

namespace sidestep::ros {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are copied as they are");

template <class T>
concept Number = std::is_arithmetic_v<T> || std::is_same_v<T, std::byte>;

/// Appends fields to bytes.
class Encoder {
 public:
  template <class T>
  using Ref = const T&;

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
  void value(const Message& message) { fields(*this, message); }

  std::vector<std::byte>& bytes_;
};

/// Takes fields from bytes; once these do not suffice, it leaves all further ones as they are.
class Decoder {
 public:
  template <class T>
  using Ref = T&;

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
  void value(Message& message) { fields(*this, message); }

  std::span<const std::byte> left_;
  bool is_whole_ = true;
};

// The fields of every message, in order: for writing and for reading.

template <class IO>
void fields(IO& io, typename IO::template Ref<Time> m) {
  io(m.sec, m.nsec);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<Duration> m) {
  io(m.sec, m.nsec);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<Header> m) {
  io(m.seq, m.stamp, m.frame_id);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<Vector3> m) {
  io(m.x, m.y, m.z);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<Point> m) {
  io(m.x, m.y, m.z);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<Quaternion> m) {
  io(m.x, m.y, m.z, m.w);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<Transform> m) {
  io(m.translation, m.rotation);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<Pose> m) {
  io(m.position, m.orientation);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<ColorRGBA> m) {
  io(m.r, m.g, m.b, m.a);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<Image> m) {
  io(m.header, m.height, m.width, m.encoding, m.is_bigendian, m.step, m.data);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<RegionOfInterest> m) {
  io(m.x_offset, m.y_offset, m.height, m.width, m.do_rectify);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<CameraInfo> m) {
  io(m.header, m.height, m.width, m.distortion_model, m.D, m.K, m.R, m.P, m.binning_x, m.binning_y,
     m.roi);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<PointField> m) {
  io(m.name, m.offset, m.datatype, m.count);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<PointCloud2> m) {
  io(m.header, m.height, m.width, m.fields, m.is_bigendian, m.point_step, m.row_step, m.data,
     m.is_dense);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<TransformStamped> m) {
  io(m.header, m.child_frame_id, m.transform);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<TFMessage> m) {
  io(m.transforms);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<JointState> m) {
  io(m.header, m.name, m.position, m.velocity, m.effort);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<Marker> m) {
  io(m.header, m.ns, m.id, m.type, m.action, m.pose, m.scale, m.color, m.lifetime, m.frame_locked,
     m.points, m.colors, m.text, m.mesh_resource, m.mesh_use_embedded_materials);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<MarkerArray> m) {
  io(m.markers);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<JointTrajectoryPoint> m) {
  io(m.positions, m.velocities, m.accelerations, m.effort, m.time_from_start);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<JointTrajectory> m) {
  io(m.header, m.joint_names, m.points);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<String> m) {
  io(m.data);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<MultiArrayDimension> m) {
  io(m.label, m.size, m.stride);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<MultiArrayLayout> m) {
  io(m.dim, m.data_offset);
}
template <class IO>
void fields(IO& io, typename IO::template Ref<UInt8MultiArray> m) {
  io(m.layout, m.data);
}

}  // namespace

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
