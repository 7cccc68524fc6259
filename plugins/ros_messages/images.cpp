#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "byte_order.hpp"
#include "conversions.hpp"

namespace sidestep::ros_messages {
namespace {

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

}  // namespace

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

}  // namespace sidestep::ros_messages
