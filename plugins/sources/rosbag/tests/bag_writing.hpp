#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <rosbag/bag.h>

#include "../rosbag_source.hpp"
#include "conformance/test_host.hpp"
#include "conversions.hpp"
#include "support/read_frames.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::rosbag::testing {

/// Writes a bag with ROS's own library.
class BagWriter {
 public:
  struct Settings {
    ::rosbag::compression::CompressionType compression = ::rosbag::compression::Uncompressed;
    std::uint32_t chunk_bytes = 768 * 1024;  ///< A chunk ends with the message that exceeds it.
  };

  explicit BagWriter(const std::filesystem::path& file) : BagWriter(file, Settings{}) {}
  BagWriter(const std::filesystem::path& file, const Settings& settings)
      : bag_(file.string(), ::rosbag::bagmode::Write) {
    bag_.setCompression(settings.compression);
    bag_.setChunkThreshold(settings.chunk_bytes);
  }

  template <class M>
  void write(const std::string& topic, Stamp received, const M& message) {
    bag_.write(topic, ros_messages::to_ros_time(received), message);
  }
  void close() { bag_.close(); }

 private:
  ::rosbag::Bag bag_;
};

inline constexpr CameraIntrinsics kCamera{40, 30, 35.0, 35.0, 19.5, 14.5};
/// Recordings begin at a time of today's.
inline constexpr std::int64_t kBegin_ns = 1'600'000'000'000'000'000;

[[nodiscard]] inline Stamp after_s(double seconds) {
  return {kBegin_ns + Stamp::from_seconds(seconds).ns};
}

/// An image that is `millimetres` everywhere.
[[nodiscard]] inline ros_messages::Image flat_image(int millimetres, Stamp stamp,
                                                    const std::string& frame = "camera") {
  const auto depth_m = static_cast<float>(millimetres / 1000.0);
  const DepthImage image{kCamera, std::vector<float>(40 * 30, depth_m)};
  return to_image(image, ros_messages::DepthEncoding::k16UC1, stamp, frame);
}

[[nodiscard]] inline ros_messages::TfMessage tf_message(const Transform& T_parent_child,
                                                        Stamp stamp, const std::string& parent,
                                                        const std::string& child) {
  ros_messages::TfMessage message;
  message.transforms.push_back(
      to_transform(ros_messages::rigid_pose(T_parent_child), stamp, parent, child));
  return message;
}

[[nodiscard]] inline Options options_of(const std::filesystem::path& file) {
  Options options;
  options.path = file;
  options.topic = "/camera/depth/image";
  return options;
}

/// A bag of camera info, a camera that stands in the world, and flat images of 1000 mm, 1001 mm,
/// and so on, 10 a second.
inline void write_flat_bag(const std::filesystem::path& file, int images,
                           const BagWriter::Settings& settings) {
  BagWriter bag(file, settings);
  bag.write("/camera/depth/camera_info", after_s(0.0),
            ros_messages::to_camera_info(kCamera, after_s(0.0), "camera"));
  bag.write(
      "/tf_static", after_s(0.0),
      tf_message(Transform(Eigen::Translation3d(1.0, 2.0, 3.0)), after_s(0.0), "map", "camera"));
  for (int i = 0; i < images; ++i) {
    bag.write("/camera/depth/image", after_s(0.1 * i + 0.01),
              flat_image(1000 + i, after_s(0.1 * i)));
  }
}

/// What came of reading a bag to its end.
struct Outcome {
  std::vector<Frame> frames;
  std::vector<Error> errors;
};

/// Reads to the end of the stream; what create_source() fails with is the only error then.
[[nodiscard]] inline Outcome read_all(const Options& options, const HostContext& context) {
  constexpr std::size_t kMost = 100'000;
  Outcome outcome;
  auto source = create_source(options, context);
  if (!source) {
    outcome.errors.push_back(source.error());
    return outcome;
  }
  for (auto& frame : testing_support::read_frames(**source, kMost)) {
    if (frame) {
      outcome.frames.push_back(std::move(*frame));
    } else {
      outcome.errors.push_back(frame.error());
    }
  }
  return outcome;
}

[[nodiscard]] inline Outcome read_all(const Options& options) {
  conformance::TestHost host;
  return read_all(options, host.context());
}

[[nodiscard]] inline std::string file_content(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace sidestep::rosbag::testing
