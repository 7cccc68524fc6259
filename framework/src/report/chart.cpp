#include <sidestep/core/format.hpp>
#include <sidestep/report/chart.hpp>

#include <algorithm>
#include <array>
#include <cmath>

namespace sidestep {
namespace {

constexpr double kTickLength = 4.0;
constexpr double kLeft = 58.0;
constexpr double kRight = 12.0;
constexpr double kTop = 26.0;
constexpr double kBottom = 44.0;

template <std::size_t N>
Colour interpolate(const std::array<Colour, N>& anchors, double share) {
  const double at = std::clamp(std::isfinite(share) ? share : 0.0, 0.0, 1.0) * (N - 1);
  const auto below = std::min(static_cast<std::size_t>(at), N - 2);
  const double part = at - static_cast<double>(below);
  const Colour& a = anchors[below];
  const Colour& b = anchors[below + 1];
  return {a.red + part * (b.red - a.red), a.green + part * (b.green - a.green),
          a.blue + part * (b.blue - a.blue), 1.0};
}

double spacing_of(const std::vector<double>& values) {
  return values.size() > 1 ? values[1] - values[0] : 1.0;
}

/// Of a decimal logarithm: "0.01", "1", "200".
std::string antilog_text(double logarithm) { return format("%.4g", std::pow(10.0, logarithm)); }

}  // namespace

Colour sequential_colour(double share) {
  constexpr std::array kAnchors = {colour(0x132B5C), colour(0x1F5A86), colour(0x2C878F),
                                   colour(0x5BB38A), colour(0xA9D38C), colour(0xF6F1B5)};
  return interpolate(kAnchors, share);
}

Colour pale_colour(double share) {
  return interpolate(std::array{sequential_colour(share), colour(0xFFFFFF)}, 0.45);
}

Colour warm_colour(double share) {
  constexpr std::array kAnchors = {colour(0xFFE3B3), colour(0xF5A64A), colour(0xD55E00),
                                   colour(0x7A2E00)};
  return interpolate(kAnchors, share);
}

void Range::include(double value) {
  if (!std::isfinite(value)) return;
  lower = std::min(lower, value);
  upper = std::max(upper, value);
}

Range Range::padded(double share) const {
  double pad = share * (upper - lower);
  if (!(pad > 0.0)) pad = std::max(0.05, 0.1 * std::abs(upper));
  return {lower - pad, upper + pad};
}

std::vector<double> ticks(const Range& range, int most) {
  const double extent = range.upper - range.lower;
  if (!(extent > 0.0) || !std::isfinite(extent)) return {range.lower};
  double step = std::pow(10.0, std::floor(std::log10(extent / most)));
  for (const double factor : {2.0, 2.5, 2.0}) {
    if (extent / step <= most) break;
    step *= factor;
  }
  std::vector<double> values;
  const double slack = 1e-9 * step;
  for (double k = std::ceil((range.lower - slack) / step); k * step <= range.upper + slack; ++k) {
    values.push_back(k * step + 0.0);  // no negative zero
  }
  return values;
}

std::vector<double> log_ticks(const Range& range) {
  constexpr double kFewDecades = 2.5;
  std::vector<double> values;
  for (double power = std::floor(range.lower); power <= range.upper; ++power) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double value = power + std::log10(factor);
      const bool is_shown = factor == 1.0 || range.upper - range.lower < kFewDecades;
      if (is_shown && value >= range.lower && value <= range.upper) values.push_back(value);
    }
  }
  return values;
}

std::string tick_text(double value, double spacing) {
  int digits = spacing > 0.0 ? static_cast<int>(std::ceil(-std::log10(spacing) - 1e-9)) : 0;
  digits = std::clamp(digits, 0, 6);
  // 2.5, 0.25, ... need one digit more than their power of ten.
  const double scaled = spacing * std::pow(10.0, digits);
  if (std::abs(scaled - std::round(scaled)) > 1e-6) ++digits;
  return format("%.*f", digits, value);
}

Axes::Axes(Canvas& canvas, const Area& area, const Range& x, const Range& y, const Labels& labels)
    : canvas_(canvas),
      plot_{area.x + kLeft, area.y + kTop, area.width - kLeft - kRight,
            area.height - kTop - kBottom},
      x_(x),
      y_(y),
      labels_(labels),
      area_(area),
      x_ticks_(labels.log_x ? log_ticks(x)
                            : ticks(x, std::clamp(static_cast<int>(plot_.width / 55.0), 3, 12))),
      y_ticks_(ticks(y, std::clamp(static_cast<int>(plot_.height / 28.0), 3, 12))) {}

Point Axes::at(double x, double y) const {
  return {plot_.x + (x - x_.lower) / (x_.upper - x_.lower) * plot_.width,
          plot_.y + plot_.height - (y - y_.lower) / (y_.upper - y_.lower) * plot_.height};
}

void Axes::grid() {
  const Stroke thin{colour(0xECECEC), 1.0, {}};
  for (const double x : x_ticks_) vertical(x, thin);
  for (const double y : y_ticks_) horizontal(y, thin);
}

void Axes::line(const std::vector<double>& x, const std::vector<double>& y, const Stroke& stroke) {
  std::vector<Point> points;
  for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i) points.push_back(at(x[i], y[i]));
  canvas_.clip(plot_);
  canvas_.line(points, stroke);
  canvas_.unclip();
}

void Axes::shares(std::vector<double> values, std::size_t all, const Stroke& stroke) {
  std::ranges::sort(values);
  std::vector<double> x{x_.lower}, share{0.0};
  for (const double value : values) {
    x.insert(x.end(), {value, value});
    share.insert(share.end(), {share.back(), share.back() + 1.0 / static_cast<double>(all)});
  }
  x.push_back(x_.upper);
  share.push_back(share.back());
  line(x, share, stroke);
}

void Axes::horizontal(double y, const Stroke& stroke) {
  line({x_.lower, x_.upper}, {y, y}, stroke);
}

void Axes::vertical(double x, const Stroke& stroke) { line({x, x}, {y_.lower, y_.upper}, stroke); }

void Axes::shade(const Range& y, const Colour& fill) {
  const double top = at(0.0, std::min(y.upper, y_.upper)).y;
  const double bottom = at(0.0, std::max(y.lower, y_.lower)).y;
  if (bottom > top) canvas_.rectangle({plot_.x, top, plot_.width, bottom - top}, fill);
}

void Axes::finish() {
  const Stroke frame{colour(0x555555), 1.0, {}};
  const TextStyle small{.size = 11.0, .align = Align::kCentre};
  const double bottom = plot_.y + plot_.height;
  canvas_.outline(plot_, frame);
  for (const double x : x_ticks_) {
    const Point p = at(x, y_.lower);
    canvas_.line(std::array{Point{p.x, bottom}, Point{p.x, bottom + kTickLength}}, frame);
    canvas_.text({p.x, bottom + 16.0},
                 labels_.log_x ? antilog_text(x) : tick_text(x, spacing_of(x_ticks_)), small);
  }
  for (const double y : y_ticks_) {
    const Point p = at(x_.lower, y);
    canvas_.line(std::array{Point{plot_.x - kTickLength, p.y}, Point{plot_.x, p.y}}, frame);
    canvas_.text({plot_.x - 7.0, p.y + 4.0}, tick_text(y, spacing_of(y_ticks_)),
                 {.size = 11.0, .align = Align::kRight});
  }
  canvas_.text({plot_.x + 0.5 * plot_.width, bottom + 34.0}, labels_.x,
               {.size = 12.0, .align = Align::kCentre});
  canvas_.text({area_.x + 14.0, plot_.y + 0.5 * plot_.height}, labels_.y,
               {.size = 12.0, .align = Align::kCentre, .upwards = true});
  canvas_.text({plot_.x, plot_.y - 9.0}, labels_.title, {.size = 13.0, .bold = true});
}

double draw_legend(Canvas& canvas, const Point& from, double width,
                   const std::vector<LegendEntry>& entries) {
  constexpr double kRow = 20.0;
  constexpr double kMark = 26.0;
  const TextStyle style{.size = 12.0};
  Point at = from;
  for (const LegendEntry& entry : entries) {
    const double needed = kMark + 6.0 + canvas.text_width(entry.text, style) + 20.0;
    if (at.x > from.x && at.x + needed > from.x + width) at = {from.x, at.y + kRow};
    const double middle = at.y + 0.5 * kRow;
    switch (entry.mark) {
      case LegendEntry::Mark::kLine:
        canvas.line(std::array{Point{at.x, middle}, Point{at.x + kMark, middle}}, entry.stroke);
        break;
      case LegendEntry::Mark::kBox:
        canvas.rectangle({at.x + 6.0, middle - 6.0, 14.0, 12.0}, entry.stroke.colour);
        canvas.outline({at.x + 6.0, middle - 6.0, 14.0, 12.0}, {colour(0x777777), 0.7, {}});
        break;
      case LegendEntry::Mark::kCircle:
        canvas.ring({at.x + 0.5 * kMark, middle}, 6.0, entry.stroke);
        break;
    }
    canvas.text({at.x + kMark + 6.0, middle + 4.0}, entry.text, style);
    at.x += needed;
  }
  return at.y + kRow - from.y;
}

void draw_colour_bar(Canvas& canvas, const Area& area, const ColourBar& bar) {
  constexpr int kSteps = 256;
  constexpr double kWidth = 14.0;
  Raster raster{1, kSteps, {}};
  for (int i = 0; i < kSteps; ++i) {
    raster.pixels.push_back(bar.colour(1.0 - static_cast<double>(i) / (kSteps - 1)));
  }
  const Area strip{area.x, area.y, kWidth, area.height};
  canvas.raster(raster, strip);
  canvas.outline(strip, {colour(0x555555), 1.0, {}});
  const std::vector<double> values =
      ticks(bar.range, std::clamp(static_cast<int>(area.height / 30.0), 3, 10));
  double widest = 0.0;
  for (const double value : values) {
    const double share = (value - bar.range.lower) / (bar.range.upper - bar.range.lower);
    const double y = strip.y + strip.height * (1.0 - share);
    const std::string text = tick_text(value, spacing_of(values));
    canvas.line(std::array{Point{strip.x + kWidth, y}, Point{strip.x + kWidth + 4.0, y}},
                {colour(0x555555), 1.0, {}});
    canvas.text({strip.x + kWidth + 7.0, y + 4.0}, text, {.size = 11.0});
    widest = std::max(widest, canvas.text_width(text, {.size = 11.0}));
  }
  canvas.text({strip.x + kWidth + 7.0 + widest + 16.0, strip.y + 0.5 * strip.height}, bar.label,
              {.size = 12.0, .align = Align::kCentre, .upwards = true});
}

}  // namespace sidestep
