#include "plan_figures.hpp"

#include <algorithm>
#include <cmath>

#include <sidestep/report/chart.hpp>
#include <sidestep/report/text_table.hpp>
#include "slices.hpp"

namespace sidestep {
namespace {

constexpr double kWidth = 900.0;
constexpr double kDistanceShown_m = 1.0;
constexpr Colour kUnknown = colour(0xB4B4B4);
constexpr Colour kOutside = colour(0xFFFFFF);
constexpr Colour kLimit = colour(0xF0F0F0);

// Reading.

/// What a slice's series holds of one item; nothing where anything is missing.
Result<std::optional<FieldSlice>> read_slice(ResultsReader& results, const std::string& series,
                                             std::int64_t item) {
  FieldSlice slice;
  for (const auto& [key, into] : {std::pair("title", &slice.title),
                                  {"u_label", &slice.u_label},
                                  {"v_label", &slice.v_label}}) {
    const auto text = SIDESTEP_TRY(results.text(series, item, key));
    *into = text.value_or("");
  }
  for (const auto& [key, into] :
       {std::pair("u0_m", &slice.u0_m), {"v0_m", &slice.v0_m}, {"step_m", &slice.step_m}}) {
    const auto number = SIDESTEP_TRY(results.number(series, item, key));
    *into = number.value_or(0.0);
  }
  for (const auto& [key, into] : {std::pair("distance_m", &slice.distance_m),
                                  {"state", &slice.state},
                                  {"circles", &slice.circles},
                                  {"base_path", &slice.base_path},
                                  {"tip_path", &slice.tip_path}}) {
    auto array = SIDESTEP_TRY(results.array(series, item, key));
    if (array) *into = std::move(*array);
  }
  const bool whole = slice.step_m > 0.0 && slice.distance_m.columns > 1 &&
                     slice.distance_m.rows > 1 &&
                     slice.state.values.size() == slice.distance_m.values.size();
  return whole ? std::optional(std::move(slice)) : std::nullopt;
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

void draw_path(Canvas& canvas, const Axes& axes, const StoredArray& path, const Stroke& stroke) {
  if (path.rows < 2) return;
  std::vector<Point> points;
  for (int row = 0; row < path.rows; ++row) {
    const auto i = static_cast<std::size_t>(row * path.columns);
    points.push_back(axes.at(path.values[i], path.values[i + 1]));
  }
  canvas.clip(axes.plot());
  canvas.line(points, {colour(0xFFFFFF), stroke.width + 2.0, {}});
  canvas.line(points, stroke);
  canvas.unclip();
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
  draw_path(canvas, axes, slice.base_path, base);
  draw_path(canvas, axes, slice.tip_path, tip);
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

struct JointRead {
  std::string name;
  std::string unit;
  double lower = 0.0;
  double upper = 0.0;
  double max_velocity = 0.0;
};

Result<std::vector<JointRead>> read_joints(ResultsReader& results) {
  std::vector<JointRead> joints;
  for (std::int64_t item = 0;; ++item) {
    const auto name = SIDESTEP_TRY(results.text("joint", item, "name"));
    if (!name) return joints;
    const auto unit = results.text("joint", item, "unit");
    const auto lower = results.number("joint", item, "lower");
    const auto upper = results.number("joint", item, "upper");
    const auto max_velocity = results.number("joint", item, "max_velocity");
    joints.push_back({*name, unit ? unit->value_or("") : "", lower ? lower->value_or(0.0) : 0.0,
                      upper ? upper->value_or(0.0) : 0.0,
                      max_velocity ? max_velocity->value_or(0.0) : 0.0});
  }
}

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
    axes.shade_below(curves[c].lower, kLimit);
    axes.shade_above(curves[c].upper, kLimit);
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
  axes.shade_below(margin_m, kLimit);
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
  const auto motion = results.array(series, 0, "motion");
  const auto joints = read_joints(results);
  const auto speed_fraction = results.number(series, 0, "speed_fraction");
  const auto margin_m = results.number(series, 0, "margin_m");
  if (!motion) return error_of(motion);
  if (!joints) return error_of(joints);
  const int dof = static_cast<int>(joints->size());
  if (!*motion || (*motion)->rows < 2 || (*motion)->columns != 2 + 2 * dof) return {};
  const std::vector<double> time_s = column_of(**motion, 0);
  const double share = speed_fraction ? speed_fraction->value_or(1.0) : 1.0;
  std::vector<Curve> positions, velocities;
  for (int j = 0; j < dof; ++j) {
    const JointRead& joint = (*joints)[static_cast<std::size_t>(j)];
    positions.push_back({joint.name, "position [" + joint.unit + "]", column_of(**motion, 2 + j),
                         joint.lower, joint.upper});
    const double fastest = share * joint.max_velocity;
    velocities.push_back({joint.name, "velocity [" + joint.unit + "/s]",
                          column_of(**motion, 2 + dof + j), -fastest, fastest});
  }
  figures.push_back(clearance_figure(time_s, column_of(**motion, 1),
                                     margin_m ? margin_m->value_or(0.0) : 0.0,
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
  for (char& c : safe) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_';
    if (!plain) c = '_';
  }
  return safe;
}

}  // namespace

Result<std::vector<Figure>> plan_figures(ResultsReader& results, std::int64_t item,
                                         const std::string& name) {
  const std::string prefix = "plan-" + std::to_string(item + 1) + "-" + file_name(name) + "-";
  const std::string series = "slice/" + std::to_string(item);
  std::vector<Figure> figures;
  const auto slices = SIDESTEP_TRY(results.array_items(series, "distance_m"));
  for (const std::int64_t index : slices) {
    const auto slice = SIDESTEP_TRY(read_slice(results, series, index));
    if (!slice) continue;
    figures.push_back(slice_figure(*slice, prefix + "slice-" + std::to_string(index + 1)));
  }
  SIDESTEP_TRY(add_motion_figures(results, item, prefix, figures));
  return figures;
}

}  // namespace sidestep
