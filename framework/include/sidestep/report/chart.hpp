#pragma once

#include <string>
#include <vector>

#include <sidestep/report/canvas.hpp>

namespace sidestep {

/// Colours that people with any kind of colour vision tell apart (Okabe and Ito, 2008).
namespace palette {
inline constexpr Colour kBlack = colour(0x000000);
inline constexpr Colour kOrange = colour(0xE69F00);
inline constexpr Colour kSky = colour(0x56B4E9);
inline constexpr Colour kGreen = colour(0x009E73);
inline constexpr Colour kBlue = colour(0x0072B2);
inline constexpr Colour kVermilion = colour(0xD55E00);
inline constexpr Colour kPurple = colour(0xCC79A7);
inline constexpr Colour kGrey = colour(0x8A8A8A);
inline constexpr Colour kPale = colour(0xE4E4E4);
}  // namespace palette

/// Dark blue over teal to light yellow for `share` from 0 to 1, of steadily growing lightness.
[[nodiscard]] Colour sequential_colour(double share);
/// The same, half way to white: a background to draw on.
[[nodiscard]] Colour pale_colour(double share);
/// White over orange to dark brown, of steadily falling lightness: for time, over the former.
[[nodiscard]] Colour warm_colour(double share);

struct Range {
  double lower = 0.0;
  double upper = 1.0;

  void include(double value);
  /// Wider by a share of itself; a range without extent gets some.
  [[nodiscard]] Range padded(double share) const;
};

/// Between 3 and `most` round numbers within a range.
[[nodiscard]] std::vector<double> ticks(const Range& range, int most);
/// Decimal logarithms of the powers of ten within a range of such, and, where these are few, of
/// twice and five times them.
[[nodiscard]] std::vector<double> log_ticks(const Range& range);
/// A tick's number with as many digits as its neighbours need.
[[nodiscard]] std::string tick_text(double value, double spacing);

/// Axes with ticks, labels and a grid around a part of a canvas, and drawing in their units.
class Axes {
 public:
  struct Labels {
    std::string title;
    std::string x;
    std::string y;
    bool log_x = false;  ///< Values of x are decimal logarithms; ticks tell of what.
  };
  /// `area` holds everything, labels included.
  Axes(Canvas& canvas, const Area& area, const Range& x, const Range& y, const Labels& labels);

  /// The inner rectangle, in which data are drawn.
  [[nodiscard]] const Area& plot() const noexcept { return plot_; }
  [[nodiscard]] Point at(double x, double y) const;
  /// Pixels for one unit of x.
  [[nodiscard]] double scale() const { return plot_.width / (x_.upper - x_.lower); }

  void grid();
  void line(const std::vector<double>& x, const std::vector<double>& y, const Stroke& stroke);
  /// The share of `all` that is no more than x: a step up at each of `values`.
  void shares(std::vector<double> values, std::size_t all, const Stroke& stroke);
  void horizontal(double y, const Stroke& stroke);
  void vertical(double x, const Stroke& stroke);
  /// Shades what lies between two values of y, which may be infinite.
  void shade(const Range& y, const Colour& fill);
  /// Frame, ticks and labels; last, over the data.
  void finish();

 private:
  Canvas& canvas_;
  Area plot_;
  Range x_;
  Range y_;
  Labels labels_;
  Area area_;
  std::vector<double> x_ticks_;
  std::vector<double> y_ticks_;
};

/// How one kind of thing in a picture looks, for its legend.
struct LegendEntry {
  enum class Mark { kLine, kBox, kCircle };
  std::string text;
  Mark mark = Mark::kLine;
  Stroke stroke;
};
/// In one row from `at` rightwards, onto further rows where `width` ends; returns the height.
double draw_legend(Canvas& canvas, const Point& at, double width,
                   const std::vector<LegendEntry>& entries);

/// A vertical bar of colours with its scale, e.g. for depth.
struct ColourBar {
  std::string label;
  Range range;
  Colour (*colour)(double share);
};
void draw_colour_bar(Canvas& canvas, const Area& area, const ColourBar& bar);

}  // namespace sidestep
