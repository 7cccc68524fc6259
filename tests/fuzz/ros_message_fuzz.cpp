#include "fuzzing.hpp"
#include "ros_messages.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

namespace {

template <class Message>
void parse_as(std::span<const std::byte> bytes) {
  const auto message = ros::parse<Message>(bytes);
  if (!is_read(message, "")) return;
  std::vector<std::byte> written;
  ros::serialise(*message, written);
  require(std::ranges::equal(written, bytes), "a message is written as it was read");
}

template <class... Messages>
void parse_as_any(std::span<const std::byte> bytes) {
  (parse_as<Messages>(bytes), ...);
}

}  // namespace

// The same bytes as a message of each type.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace sidestep::ros;
  parse_as_any<Image, CameraInfo, PointCloud2, TFMessage, JointState, MarkerArray, JointTrajectory,
               String, UInt8MultiArray>(std::as_bytes(std::span(data, size)));
  return 0;
}
