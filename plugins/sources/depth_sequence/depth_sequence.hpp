#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <sidestep/core/log.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/sensing/source.hpp>

namespace sidestep::depth_sequence {

/// Overrides of what the sequence's own files and its layout's defaults say.
struct CameraOptions {
  std::optional<int> width_px;
  std::optional<int> height_px;
  std::optional<double> fx_px;
  std::optional<double> fy_px;
  std::optional<double> cx_px;
  std::optional<double> cy_px;

  static Parameters<CameraOptions> parameters() {
    using C = CameraOptions;
    return Parameters<C>()
        .add("width_px", &C::width_px, "Width of every image; null: that of the first ones.",
             {.unit = "px", .min = 1})
        .add("height_px", &C::height_px, "Height of every image; null: that of the first ones.",
             {.unit = "px", .min = 1})
        .add("fx_px", &C::fx_px, "Focal length along x; null: the sequence's own.",
             {.unit = "px", .min = 1e-3})
        .add("fy_px", &C::fy_px, "Focal length along y; null: the sequence's own.",
             {.unit = "px", .min = 1e-3})
        .add("cx_px", &C::cx_px, "Column of the principal point; null: the sequence's own.",
             {.unit = "px"})
        .add("cy_px", &C::cy_px, "Row of the principal point; null: the sequence's own.",
             {.unit = "px"});
  }
};

struct Options {
  std::filesystem::path path;
  std::string format = "auto";
  std::optional<double> depth_scale;
  int first_frame = 0;
  int max_frames = 0;
  int stride = 1;
  double rate_hz = 30.0;
  bool use_world = true;
  double depth_min_m = 0.0;
  double depth_max_m = 10.0;
  double max_pose_gap_s = 0.1;
  CameraOptions camera;

  static Parameters<Options> parameters() {
    using O = Options;
    return Parameters<O>()
        .add("path", &O::path, "Folder of the sequence.", {.required = true})
        .add("format", &O::format, "Layout of the folder; auto: told from the files in it.",
             {.choices = {"auto", "seven_scenes", "tum", "open3d"}})
        .add("depth_scale", &O::depth_scale,
             "Raw units in a metre; null: the layout's own, 1000 for seven_scenes and open3d, 5000 "
             "for tum.",
             {.unit = "1/m", .min = 1e-6})
        .add("first_frame", &O::first_frame, "Frames left out at the beginning.", {.min = 0})
        .add("max_frames", &O::max_frames, "Frames handed out at most; 0: all.", {.min = 0})
        .add("stride", &O::stride, "Every how many frames one is handed out.", {.min = 1})
        .add("rate_hz", &O::rate_hz, "Frames a second, for the stamps of seven_scenes and open3d.",
             {.unit = "Hz", .min = 1e-3})
        .add("use_world", &O::use_world,
             "Whether T_world_sequence of the folder's world.yaml, if there is one, is applied.")
        .add("depth_min_m", &O::depth_min_m, "Nearer depths count as no measurement.",
             {.unit = "m", .min = 0.0})
        .add("depth_max_m", &O::depth_max_m, "Farther depths count as no measurement.",
             {.unit = "m", .min = 0.0})
        .add("max_pose_gap_s", &O::max_pose_gap_s,
             "Longest time between two poses of tum that are interpolated.",
             {.unit = "s", .min = 0.0})
        .add("camera", &O::camera, "Intrinsics, where the sequence's own do not apply.");
  }
  [[nodiscard]] std::vector<OptionMistake> check() const {
    if (depth_min_m < depth_max_m) return {};
    return {{{"depth_min_m", "depth_max_m"}, "must be less than depth_max_m", {}}};
  }
};

/// Opens a recorded sequence. Fails with kNotFound where the folder or a layout that is
/// understood is missing, kConfig where intrinsics or world.yaml are wrong.
[[nodiscard]] Result<std::unique_ptr<Source>> create_source(const Options& options, Log& log,
                                                            const DocumentReader& documents);

}  // namespace sidestep::depth_sequence
