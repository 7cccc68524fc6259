#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <functional>
#include <numeric>

#include <sidestep/report/chart.hpp>
#include <sidestep/report/report_parts.hpp>
#include "plan_parts.hpp"

namespace sidestep {
namespace {

constexpr const char* kFile = "results.sqlite";
constexpr double kWidth = 900.0;
constexpr double kDistanceShown_m = 1.0;
constexpr Colour kUnknown = colour(0xB4B4B4);
constexpr Colour kOutside = colour(0xFFFFFF);
constexpr Colour kLimit = colour(0xF0F0F0);
constexpr Colour kNoMeasurement = colour(0xDDDDDD);

double number_of(ResultsReader& results, const std::string& series, std::int64_t item,
                 std::string_view key, double otherwise = 0.0) {
  const auto number = results.number(series, item, key);
  return number ? number->value_or(otherwise) : otherwise;
}

/// The largest depth worth a colour: all but the farthest hundredth of the measurements.
double depth_limit(const std::vector<DepthPicture>& images) {
  std::vector<float> values;
  for (const DepthPicture& image : images) {
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

Figure depth_figure(const std::vector<DepthPicture>& images) {
  constexpr double kBar = 80.0;
  constexpr double kCaption = 22.0;
  const int columns = std::min(3, static_cast<int>(images.size()));
  const int rows = (static_cast<int>(images.size()) + columns - 1) / columns;
  const StoredArray& first = images.front().depth_m;
  const double cell = (kWidth - kBar) / columns;
  const double picture_width = cell - 10.0;
  const double picture_height = picture_width * first.rows / std::max(1, first.columns);
  const double legend = 30.0;
  Figure figure{"depth", "Depth images, as the mapper got them.",
                Canvas(kWidth, rows * (picture_height + kCaption) + legend)};
  const double limit_m = depth_limit(images);
  for (std::size_t i = 0; i < images.size(); ++i) {
    const double x = cell * static_cast<double>(static_cast<int>(i) % columns);
    const double y =
        (picture_height + kCaption) * static_cast<double>(static_cast<int>(i) / columns);
    figure.canvas.text({x, y + 15.0}, "frame " + std::to_string(images[i].frame_sequence),
                       {.size = 12.0, .bold = true});
    const Area area{x, y + kCaption, picture_width, picture_height};
    figure.canvas.raster(depth_raster(images[i].depth_m, limit_m), area);
    figure.canvas.outline(area, {colour(0x777777), 0.7, {}});
  }
  draw_colour_bar(figure.canvas,
                  {kWidth - kBar + 8.0, kCaption, kBar, std::min(picture_height, 260.0)},
                  {"depth [m]", {0.0, limit_m}, &sequential_colour});
  draw_legend(figure.canvas, {0.0, figure.canvas.height() - 25.0}, kWidth,
              {{"no measurement", LegendEntry::Mark::kBox, {kNoMeasurement, 1.0, {}}}});
  return figure;
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
                Canvas(kWidth, kHeight)};
  std::vector<double> frame_ms(std::min(integrate_ms.size(), field_ms.size()));
  std::ranges::transform(integrate_ms, field_ms, frame_ms.begin(), std::plus{});
  std::vector<double> index(frame_ms.size());
  std::iota(index.begin(), index.end(), 0.0);
  Range y{0.0, 0.0};
  for (const double value : frame_ms) y.include(value);
  y.upper = y.upper > 0.0 ? 1.08 * y.upper : 1.0;
  const Range x{0.0, std::max(1.0, index.empty() ? 1.0 : index.back())};
  Axes axes(figure.canvas, {0.0, 0.0, 0.6 * kWidth, kHeight - 30.0}, x, y,
            {"Over the run", "frame", "time [ms]"});
  const Stroke whole{palette::kBlack, 1.3, {}};
  const Stroke integrate{palette::kBlue, 1.3, {}};
  const Stroke field{palette::kVermilion, 1.3, {}};
  axes.grid();
  axes.line(index, frame_ms, whole);
  axes.line(index, integrate_ms, integrate);
  axes.line(index, field_ms, field);
  axes.finish();
  draw_histogram(figure.canvas, {0.6 * kWidth, 0.0, 0.4 * kWidth, kHeight - 30.0}, frame_ms);
  draw_legend(figure.canvas, {58.0, kHeight - 26.0}, kWidth,
              {{"whole frame", LegendEntry::Mark::kLine, whole},
               {"integration", LegendEntry::Mark::kLine, integrate},
               {"distance field", LegendEntry::Mark::kLine, field}});
  return figure;
}

bool is_whole(const FieldSlice& slice) {
  return slice.step_m > 0.0 && slice.distance_m.columns > 1 && slice.distance_m.rows > 1 &&
         slice.state.values.size() == slice.distance_m.values.size();
}

/// Column `column` of an array.
std::vector<double> column_of(const StoredArray& array, int column) {
  std::vector<double> values;
  for (int row = 0; row < array.rows; ++row) {
    values.push_back(array.values[static_cast<std::size_t>(row * array.columns + column)]);
  }
  return values;
}

// Slices.

Raster slice_raster(const FieldSlice& slice, double shown_m) {
  const int rows = slice.distance_m.rows;
  const int columns = slice.distance_m.columns;
  Raster raster{columns, rows, {}};
  for (int row = rows - 1; row >= 0; --row) {  // pictures begin at the top, slices below
    for (int column = 0; column < columns; ++column) {
      const auto i = static_cast<std::size_t>(row * columns + column);
      switch (static_cast<SliceState>(static_cast<int>(slice.state.values[i]))) {
        case SliceState::kOccupied: raster.pixels.push_back(palette::kBlack); break;
        case SliceState::kUnknown: raster.pixels.push_back(kUnknown); break;
        case SliceState::kOutside: raster.pixels.push_back(kOutside); break;
        default: raster.pixels.push_back(pale_colour(slice.distance_m.values[i] / shown_m));
      }
    }
  }
  return raster;
}

void draw_spheres(Canvas& canvas, const Axes& axes, const StoredArray& circles) {
  const auto each = [&](auto draw) {
    for (int row = 0; row < circles.rows; ++row) {
      const float* c = circles.values.data() + static_cast<std::ptrdiff_t>(row) * circles.columns;
      draw(axes.at(c[0], c[1]), c[2] * axes.scale(), static_cast<double>(c[3]));
    }
  };
  canvas.clip(axes.plot());
  each([&](const Point& at, double radius, double share) {
    canvas.circle(at, radius, warm_colour(share).with_alpha(0.10));
  });
  each([&](const Point& at, double radius, double share) {
    const bool end = share == 0.0 || share == 1.0;
    if (!end) canvas.ring(at, radius, {warm_colour(share).with_alpha(0.55), 0.7, {}});
  });
  each([&](const Point& at, double radius, double share) {
    if (share == 0.0) canvas.ring(at, radius, {palette::kBlue, 2.2, {}});
    if (share == 1.0) canvas.ring(at, radius, {palette::kPurple, 2.2, {}});
  });
  canvas.unclip();
}

void draw_path(Axes& axes, const StoredArray& path, const Stroke& stroke) {
  if (path.rows < 2) return;
  const std::vector<double> u = column_of(path, 0), v = column_of(path, 1);
  axes.line(u, v, {colour(0xFFFFFF), stroke.width + 2.0, {}});
  axes.line(u, v, stroke);
}

Figure slice_figure(const FieldSlice& slice, std::string file) {
  constexpr double kBar = 84.0;
  constexpr double kLargestPlot = 760.0;
  const Range u{slice.u0_m - 0.5 * slice.step_m,
                slice.u0_m + (slice.distance_m.columns - 0.5) * slice.step_m};
  const Range v{slice.v0_m - 0.5 * slice.step_m,
                slice.v0_m + (slice.distance_m.rows - 0.5) * slice.step_m};
  // The margins that Axes keeps for its labels.
  const double across = 70.0;
  const double down = 70.0;
  const double aspect = (v.upper - v.lower) / (u.upper - u.lower);
  double plot_width = kWidth - kBar - across;
  if (plot_width * aspect > kLargestPlot) plot_width = kLargestPlot / aspect;
  const double plot_height = plot_width * aspect;
  Figure figure{std::move(file),
                slice.title + ": where spheres cross the cut, and paths as seen along its normal.",
                Canvas(kWidth, plot_height + down + 48.0)};
  Canvas& canvas = figure.canvas;
  Axes axes(canvas, {0.0, 0.0, plot_width + across, plot_height + down}, u, v,
            {slice.title, slice.u_label, slice.v_label});
  canvas.raster(slice_raster(slice, kDistanceShown_m), axes.plot());
  draw_spheres(canvas, axes, slice.circles);
  const Stroke base{palette::kBlack, 2.0, {}};
  const Stroke tip{palette::kVermilion, 2.0, {6.0, 4.0}};
  draw_path(axes, slice.base_path, base);
  draw_path(axes, slice.tip_path, tip);
  axes.finish();
  draw_colour_bar(canvas,
                  {plot_width + across + 8.0, axes.plot().y, kBar, std::min(plot_height, 320.0)},
                  {"distance to obstacles [m]", {0.0, kDistanceShown_m}, &pale_colour});
  std::vector<LegendEntry> legend = {
      {"occupied", LegendEntry::Mark::kBox, {palette::kBlack, 1.0, {}}},
      {"never seen", LegendEntry::Mark::kBox, {kUnknown, 1.0, {}}},
      {"robot at the start", LegendEntry::Mark::kCircle, {palette::kBlue, 2.2, {}}},
      {"at the goal", LegendEntry::Mark::kCircle, {palette::kPurple, 2.2, {}}}};
  if (slice.tip_path.rows > 1) {
    legend.push_back({"on its way", LegendEntry::Mark::kCircle, {warm_colour(0.5), 1.0, {}}});
  }
  if (slice.base_path.rows > 1)
    legend.push_back({"path of the base", LegendEntry::Mark::kLine, base});
  if (slice.tip_path.rows > 1) legend.push_back({"path of the tip", LegendEntry::Mark::kLine, tip});
  draw_legend(canvas, {58.0, plot_height + down + 2.0}, kWidth - 60.0, legend);
  return figure;
}

// Curves over time.

struct Curve {
  std::string title;
  std::string label;
  std::vector<double> values;
  double lower = 0.0;
  double upper = 0.0;
};

/// Small charts side by side, one a joint, with what lies beyond the limits shaded.
Figure curves_figure(const std::vector<double>& time_s, const std::vector<Curve>& curves,
                     std::string file, std::string caption) {
  constexpr int kColumns = 2;
  constexpr double kCell = 190.0;
  const int rows = (static_cast<int>(curves.size()) + kColumns - 1) / kColumns;
  Figure figure{std::move(file), std::move(caption), Canvas(kWidth, rows * kCell + 28.0)};
  const Stroke limit{palette::kVermilion, 1.3, {5.0, 3.0}};
  const Stroke curve{palette::kBlue, 2.0, {}};
  for (std::size_t c = 0; c < curves.size(); ++c) {
    Range y{curves[c].values.front(), curves[c].values.front()};
    for (const double value : curves[c].values) y.include(value);
    // Limits are shown where they are near enough to matter; a far one would flatten the curve.
    const double reach = std::max(y.upper - y.lower, 0.1);
    if (curves[c].lower > y.lower - 2.0 * reach) y.include(curves[c].lower);
    if (curves[c].upper < y.upper + 2.0 * reach) y.include(curves[c].upper);
    const Area area{kWidth / kColumns * static_cast<double>(c % kColumns),
                    kCell * static_cast<double>(c / kColumns), kWidth / kColumns, kCell};
    Axes axes(figure.canvas, area, {0.0, std::max(1e-3, time_s.back())}, y.padded(0.12),
              {curves[c].title, "time [s]", curves[c].label});
    axes.shade({-INFINITY, curves[c].lower}, kLimit);
    axes.shade({curves[c].upper, INFINITY}, kLimit);
    axes.grid();
    axes.horizontal(curves[c].lower, limit);
    axes.horizontal(curves[c].upper, limit);
    axes.line(time_s, curves[c].values, curve);
    axes.finish();
  }
  draw_legend(figure.canvas, {58.0, rows * kCell + 2.0}, kWidth,
              {{"planned", LegendEntry::Mark::kLine, curve},
               {"limit", LegendEntry::Mark::kLine, limit},
               {"beyond the limit", LegendEntry::Mark::kBox, {kLimit, 1.0, {}}}});
  return figure;
}

Figure clearance_figure(const std::vector<double>& time_s, const std::vector<double>& clearance_m,
                        double margin_m, std::string file) {
  constexpr double kHeight = 300.0;
  Figure figure{std::move(file),
                "Clearance over time: the smallest distance from any of the robot's spheres to an "
                "obstacle in the field.",
                Canvas(kWidth, kHeight + 28.0)};
  Range y{0.0, 0.1};
  for (const double value : clearance_m) y.include(value);
  Axes axes(figure.canvas, {0.0, 0.0, kWidth, kHeight}, {0.0, std::max(1e-3, time_s.back())},
            y.padded(0.06), {"Clearance", "time [s]", "clearance [m]"});
  const Stroke curve{palette::kBlue, 2.0, {}};
  const Stroke margin{palette::kVermilion, 1.3, {5.0, 3.0}};
  axes.shade({-INFINITY, margin_m}, kLimit);
  axes.grid();
  axes.horizontal(margin_m, margin);
  axes.line(time_s, clearance_m, curve);
  axes.finish();
  draw_legend(figure.canvas, {58.0, kHeight + 2.0}, kWidth,
              {{"nearest sphere", LegendEntry::Mark::kLine, curve},
               {"required: " + format("%.3f m", margin_m), LegendEntry::Mark::kLine, margin}});
  return figure;
}

Result<void> add_motion_figures(ResultsReader& results, std::int64_t item,
                                const std::string& prefix, std::vector<Figure>& figures) {
  const std::string series = "motion/" + std::to_string(item);
  const auto motion = SIDESTEP_TRY(results.array(series, 0, "motion"));
  if (!motion || motion->rows < 2 || motion->columns < 2 || motion->columns % 2 != 0) return {};
  const std::vector<double> time_s = column_of(*motion, 0);
  const double share = number_of(results, series, 0, "speed_fraction", 1.0);
  const int dof = (motion->columns - 2) / 2;
  std::vector<Curve> positions, velocities;
  const auto joints = SIDESTEP_TRY(stored_joint().read_all(results, "joint", kFile));
  if (std::ssize(joints) != dof) return {};  // of another robot
  for (const auto& [number, joint] : joints) {
    const int j = static_cast<int>(number);
    const std::string unit = joint.unit();
    positions.push_back({joint.name, "position [" + unit + "]", column_of(*motion, 2 + j),
                         joint.lower, joint.upper});
    const double fastest = share * joint.max_velocity;
    velocities.push_back({joint.name, "velocity [" + unit + "/s]", column_of(*motion, 2 + dof + j),
                          -fastest, fastest});
  }
  figures.push_back(clearance_figure(time_s, column_of(*motion, 1),
                                     number_of(results, series, 0, "margin_m"),
                                     prefix + "clearance"));
  figures.push_back(curves_figure(
      time_s, positions, prefix + "joints",
      "Joint positions against their limits; a limit far from the curve is not drawn."));
  figures.push_back(curves_figure(time_s, velocities, prefix + "velocities",
                                  "Joint velocities against the limits that plans must keep; a "
                                  "limit far from the curve is not drawn."));
  return {};
}

/// A name as a file's: letters, digits, - and _.
std::string file_name(const std::string& name) {
  std::string safe = name.substr(0, 60);
  const auto is_other = [](unsigned char c) { return c >= 0x80 || !(std::isalnum(c) || c == '-'); };
  std::ranges::replace_if(safe, is_other, '_');
  return safe;
}

}  // namespace

Result<std::vector<Figure>> map_figures(ResultsReader& results) {
  std::vector<Figure> figures;
  auto pictures = SIDESTEP_TRY(stored_picture().read_all(results, "depth", kFile));
  std::vector<DepthPicture> images;
  images.reserve(pictures.size());
  for (auto& [item, picture] : pictures) images.push_back(std::move(picture));
  if (!images.empty()) figures.push_back(depth_figure(images));
  const auto integrate_ms = SIDESTEP_TRY(results.column("frame", "integrate_ms"));
  const auto field_ms = SIDESTEP_TRY(results.column("frame", "field_ms"));
  if (!integrate_ms.empty()) figures.push_back(frame_time_figure(integrate_ms, field_ms));
  return figures;
}

Result<std::vector<Figure>> plan_figures(ResultsReader& results, std::int64_t item,
                                         const std::string& name) {
  const std::string prefix = "plan-" + std::to_string(item + 1) + "-" + file_name(name) + "-";
  const std::string series = "slice/" + std::to_string(item);
  std::vector<Figure> figures;
  const auto slices = SIDESTEP_TRY(stored_slice().read_all(results, series, kFile));
  for (const auto& [index, slice] : slices) {
    if (!is_whole(slice)) continue;
    figures.push_back(slice_figure(slice, prefix + "slice-" + std::to_string(index + 1)));
  }
  SIDESTEP_TRY(add_motion_figures(results, item, prefix, figures));
  return figures;
}

}  // namespace sidestep
