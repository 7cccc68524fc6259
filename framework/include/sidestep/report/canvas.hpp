#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>

namespace sidestep {

struct Colour {
  double red = 0.0;
  double green = 0.0;
  double blue = 0.0;
  double alpha = 1.0;

  [[nodiscard]] Colour with_alpha(double value) const { return {red, green, blue, value}; }
};
/// From 0xRRGGBB.
[[nodiscard]] constexpr Colour colour(std::uint32_t rgb) {
  return {(rgb >> 16 & 0xFFu) / 255.0, (rgb >> 8 & 0xFFu) / 255.0, (rgb & 0xFFu) / 255.0, 1.0};
}

/// Pixels to be shown as a picture within a picture. Rows from the top.
struct Raster {
  int width = 0;
  int height = 0;
  std::vector<Colour> pixels;
};

struct Point {
  double x = 0.0;
  double y = 0.0;
};
struct Area {
  double x = 0.0;
  double y = 0.0;
  double width = 0.0;
  double height = 0.0;
};

struct Stroke {
  Colour colour;
  double width = 1.5;
  std::vector<double> dashes;
};

enum class Align { kLeft, kCentre, kRight };
struct TextStyle {
  double size = 12.0;
  Colour colour{0.13, 0.13, 0.13, 1.0};
  Align align = Align::kLeft;
  bool bold = false;
  bool upwards = false;  ///< Turned by 90 degrees, reading from below.
};

/// A picture in the making: drawn once, written as PNG or SVG. Units are pixels from the upper
/// left corner. Cairo lives behind this.
class Canvas {
 public:
  Canvas(double width, double height);
  ~Canvas();
  Canvas(Canvas&&) noexcept;
  Canvas& operator=(Canvas&&) noexcept;

  [[nodiscard]] double width() const noexcept { return width_; }
  [[nodiscard]] double height() const noexcept { return height_; }

  void line(std::span<const Point> points, const Stroke& stroke);
  void polygon(std::span<const Point> corners, const Colour& fill);
  void rectangle(const Area& area, const Colour& fill);
  void outline(const Area& area, const Stroke& stroke);
  void circle(const Point& centre, double radius, const Colour& fill);
  void ring(const Point& centre, double radius, const Stroke& stroke);
  /// `at` is the baseline's left end, middle or right end, as style.align says.
  void text(const Point& at, const std::string& text, const TextStyle& style);
  [[nodiscard]] double text_width(const std::string& text, const TextStyle& style);
  /// Stretches a raster over an area, without smoothing.
  void raster(const Raster& raster, const Area& area);

  /// Until unclip(), nothing is drawn outside `area`.
  void clip(const Area& area);
  void unclip();

  /// `scale` pixels of the file for one of the canvas.
  [[nodiscard]] Result<void> write_png(const std::filesystem::path& file, double scale = 2.0) const;
  [[nodiscard]] Result<void> write_svg(const std::filesystem::path& file) const;

 private:
  struct Impl;
  double width_;
  double height_;
  std::unique_ptr<Impl> impl_;
};

/// One picture of a report.
struct Figure {
  std::string file;  ///< Name without suffix.
  std::string caption;
  Canvas canvas;
};

}  // namespace sidestep
