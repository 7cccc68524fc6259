#pragma once

#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <vector>

#include <png.h>

#include <sidestep/sensing/frame.hpp>

namespace sidestep::testing_support {

/// Frames of the recorded kitchen, read without any of Sidestep's own sources. Link PNG::PNG.
class KinectKitchen {
 public:
  explicit KinectKitchen(std::filesystem::path shared_data)
      : folder_(std::move(shared_data) / "kinect_kitchen") {}

  [[nodiscard]] bool present() const { return std::filesystem::exists(file(0, ".depth.png")); }

  /// Nothing where the frame's files cannot be read.
  [[nodiscard]] std::optional<Frame> frame(int number) const {
    Frame frame;
    frame.sequence = number;
    frame.stamp = Stamp::from_seconds(number / 30.0);
    Eigen::Matrix4d pose;
    std::ifstream poses(file(number, ".pose.txt"));
    for (int i = 0; i < 16; ++i) poses >> pose(i / 4, i % 4);
    if (!poses) return std::nullopt;
    frame.T_world_camera.matrix() = T_world_sequence() * pose;
    auto image = depth(file(number, ".depth.png"));
    if (!image) return std::nullopt;
    frame.measurement = std::move(*image);
    return frame;
  }

 private:
  [[nodiscard]] std::filesystem::path file(int number, const char* suffix) const {
    std::string digits = std::to_string(number);
    digits.insert(0, 6 - digits.size(), '0');
    return folder_ / ("frame-" + digits + suffix);
  }

  /// From the sequence's README: z up, floor at 0.
  [[nodiscard]] static Eigen::Matrix4d T_world_sequence() {
    Eigen::Matrix4d transform;
    transform << 0.003912, -0.448678, 0.893685, 0.0, -0.999962, -0.008718, 0.0, 0.0, 0.007791,
        -0.893651, -0.448695, 1.518519, 0.0, 0.0, 0.0, 1.0;
    return transform;
  }

  [[nodiscard]] static std::optional<DepthImage> depth(const std::filesystem::path& path) {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> input(std::fopen(path.c_str(), "rb"),
                                                                &std::fclose);
    if (!input) return std::nullopt;
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(png);
    png_init_io(png, input.get());
    png_read_png(png, info, PNG_TRANSFORM_SWAP_ENDIAN, nullptr);
    DepthImage image;
    image.camera = {static_cast<int>(png_get_image_width(png, info)),
                    static_cast<int>(png_get_image_height(png, info)),
                    585.0,
                    585.0,
                    320.0,
                    240.0};
    png_bytepp rows = png_get_rows(png, info);
    for (int v = 0; v < image.camera.height_px; ++v) {
      const auto* millimetres = reinterpret_cast<const std::uint16_t*>(rows[v]);
      for (int u = 0; u < image.camera.width_px; ++u) {
        const std::uint16_t mm = millimetres[u];
        image.depth_m.push_back(mm == 65535 ? 0.0F : static_cast<float>(mm) * 0.001F);
      }
    }
    png_destroy_read_struct(&png, &info, nullptr);
    return image;
  }

  std::filesystem::path folder_;
};

}  // namespace sidestep::testing_support
