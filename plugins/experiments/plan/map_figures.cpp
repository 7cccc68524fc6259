#include "plan_figures.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <sidestep/report/chart.hpp>
#include <sidestep/report/text_table.hpp>

namespace sidestep {
namespace {

constexpr double kMapWidth = 900.0;
constexpr Colour kNoMeasurement = colour(0xDDDDDD);

struct DepthImageRead {
  double sequence = 0.0;
  StoredArray depth_m;
};

/// The largest depth worth a colour: all but the farthest hundredth of the measurements.
double depth_limit(const std::vector<DepthImageRead>& images) {
  std::vector<float> values;
  for (const DepthImageRead& image : images) {
    for (std::size_t i = 0; i < image.depth_m.values.size(); i += 7) {
      const float depth = image.depth_m.values[i];
      if (std::isfinite(depth) && depth > 0.0F) values.push_back(depth);
    }
  }
  if (values.empty()) return 1.0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return std::max(0.1, static_cast<double>(*at));
}

Raster depth_raster(const StoredArray& depth_m, double limit_m) {
  Raster raster{depth_m.columns, depth_m.rows, {}};
  raster.pixels.reserve(depth_m.values.size());
  for (const float depth : depth_m.values) {
    const bool measured = std::isfinite(depth) && depth > 0.0F;
    raster.pixels.push_back(measured ? sequential_colour(depth / limit_m) : kNoMeasurement);
  }
  return raster;
}

Figure depth_figure(const std::vector<DepthImageRead>& images) {
  constexpr double kBar = 80.0;
  constexpr double kCaption = 22.0;
  const int columns = std::min(3, static_cast<int>(images.size()));
  const int rows = (static_cast<int>(images.size()) + columns - 1) / columns;
  const StoredArray& first = images.front().depth_m;
  const double cell = (kMapWidth - kBar) / columns;
  const double picture_width = cell - 10.0;
  const double picture_height = picture_width * first.rows / std::max(1, first.columns);
  const double legend = 30.0;
  Figure figure{"depth", "Depth images, as the mapper got them.",
                Canvas(kMapWidth, rows * (picture_height + kCaption) + legend)};
  const double limit_m = depth_limit(images);
  for (std::size_t i = 0; i < images.size(); ++i) {
    const double x = cell * static_cast<double>(static_cast<int>(i) % columns);
    const double y =
        (picture_height + kCaption) * static_cast<double>(static_cast<int>(i) / columns);
    figure.canvas.text({x, y + 15.0}, "frame " + format("%.0f", images[i].sequence),
                       {.size = 12.0, .bold = true});
    const Area area{x, y + kCaption, picture_width, picture_height};
    figure.canvas.raster(depth_raster(images[i].depth_m, limit_m), area);
    figure.canvas.outline(area, {colour(0x777777), 0.7, {}});
  }
  draw_colour_bar(figure.canvas,
                  {kMapWidth - kBar + 8.0, kCaption, kBar, std::min(picture_height, 260.0)},
                  {"depth [m]", {0.0, limit_m}, &sequential_colour});
  draw_legend(figure.canvas, {0.0, figure.canvas.height() - 25.0}, kMapWidth,
              {{"no measurement", LegendEntry::Mark::kBox, {kNoMeasurement, 1.0, {}}}});
  return figure;
}

std::vector<double> sums(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> total;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) total.push_back(a[i] + b[i]);
  return total;
}

void draw_histogram(Canvas& canvas, const Area& area, const std::vector<double>& values) {
  constexpr int kBins = 30;
  Range x{0.0, 0.0};
  for (const double value : values) x.include(value);
  if (!(x.upper > 0.0)) x.upper = 1.0;
  x.upper *= 1.0001;
  std::array<int, kBins> counts{};
  for (const double value : values) {
    ++counts[static_cast<std::size_t>(std::clamp(value / x.upper * kBins, 0.0, kBins - 1.0))];
  }
  const Range y{0.0, 1.1 * *std::ranges::max_element(counts)};
  Axes axes(canvas, area, x, y, {"Distribution", "frame time [ms]", "frames"});
  axes.grid();
  for (int b = 0; b < kBins; ++b) {
    const Point low = axes.at(x.upper * b / kBins, 0.0);
    const Point high = axes.at(x.upper * (b + 1) / kBins, counts[static_cast<std::size_t>(b)]);
    canvas.rectangle({low.x + 0.5, high.y, high.x - low.x - 1.0, low.y - high.y}, palette::kBlue);
  }
  axes.finish();
}

Figure frame_time_figure(const std::vector<double>& integrate_ms,
                         const std::vector<double>& field_ms) {
  constexpr double kHeight = 330.0;
  Figure figure{"frame_times", "Wall time from a frame in hand to the published field, by stage.",
                Canvas(kMapWidth, kHeight)};
  const std::vector<double> frame_ms = sums(integrate_ms, field_ms);
  std::vector<double> index(frame_ms.size());
  for (std::size_t i = 0; i < index.size(); ++i) index[i] = static_cast<double>(i);
  Range y{0.0, 0.0};
  for (const double value : frame_ms) y.include(value);
  y.upper = y.upper > 0.0 ? 1.08 * y.upper : 1.0;
  const Range x{0.0, std::max(1.0, index.empty() ? 1.0 : index.back())};
  Axes axes(figure.canvas, {0.0, 0.0, 0.6 * kMapWidth, kHeight - 30.0}, x, y,
            {"Over the run", "frame", "time [ms]"});
  const Stroke whole{palette::kBlack, 1.3, {}};
  const Stroke integrate{palette::kBlue, 1.3, {}};
  const Stroke field{palette::kVermilion, 1.3, {}};
  axes.grid();
  axes.line(index, frame_ms, whole);
  axes.line(index, integrate_ms, integrate);
  axes.line(index, field_ms, field);
  axes.finish();
  draw_histogram(figure.canvas, {0.6 * kMapWidth, 0.0, 0.4 * kMapWidth, kHeight - 30.0}, frame_ms);
  draw_legend(figure.canvas, {58.0, kHeight - 26.0}, kMapWidth,
              {{"whole frame", LegendEntry::Mark::kLine, whole},
               {"integration", LegendEntry::Mark::kLine, integrate},
               {"distance field", LegendEntry::Mark::kLine, field}});
  return figure;
}

}  // namespace

Result<std::vector<Figure>> map_figures(ResultsReader& results) {
  std::vector<Figure> figures;
  const auto items = SIDESTEP_TRY(results.array_items("depth", "depth_m"));
  std::vector<DepthImageRead> images;
  for (const std::int64_t item : items) {
    auto depth_m = SIDESTEP_TRY(results.array("depth", item, "depth_m"));
    const auto sequence = results.number("depth", item, "sequence");
    if (!depth_m || depth_m->values.empty()) continue;
    images.push_back({sequence ? sequence->value_or(0.0) : 0.0, std::move(*depth_m)});
  }
  if (!images.empty()) figures.push_back(depth_figure(images));
  const auto integrate_ms = results.column("frame", "integrate_ms");
  const auto field_ms = results.column("frame", "field_ms");
  if (!integrate_ms) return error_of(integrate_ms);
  if (!field_ms) return error_of(field_ms);
  if (!integrate_ms->empty()) figures.push_back(frame_time_figure(*integrate_ms, *field_ms));
  return figures;
}

}  // namespace sidestep
