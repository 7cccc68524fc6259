#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/plugin/context.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/sensing/source.hpp>

namespace sidestep::simulator {

/// The defaults are those of the Xtion on the HSR's head.
struct CameraOptions {
  int width_px = 640;
  int height_px = 480;
  double fx_px = 554.38;
  double fy_px = 554.38;
  double cx_px = 319.5;
  double cy_px = 239.5;

  static Parameters<CameraOptions> parameters() {
    using C = CameraOptions;
    return Parameters<C>()
        .add("width_px", &C::width_px, "Width of the image.", {.unit = "px", .min = 1, .max = 8192})
        .add("height_px", &C::height_px, "Height of the image.",
             {.unit = "px", .min = 1, .max = 8192})
        .add("fx_px", &C::fx_px, "Focal length along x.", {.unit = "px", .min = 1e-3})
        .add("fy_px", &C::fy_px, "Focal length along y.", {.unit = "px", .min = 1e-3})
        .add("cx_px", &C::cx_px, "Column of the principal point.", {.unit = "px"})
        .add("cy_px", &C::cy_px, "Row of the principal point.", {.unit = "px"});
  }
};

/// Where the camera is at one time, and where it looks.
struct CameraWaypoint {
  double time_s = 0.0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> look_at_m;
  std::optional<Eigen::Vector3d> rpy_rad;

  static Parameters<CameraWaypoint> parameters() {
    using W = CameraWaypoint;
    return Parameters<W>()
        .add("time_s", &W::time_s, "When the camera is here; increases along the path.",
             {.unit = "s", .required = true})
        .add("position_m", &W::position_m, "Where it is, in the world frame.",
             {.unit = "m", .required = true})
        .add("look_at_m", &W::look_at_m, "A point in the world in the middle of the image.",
             {.unit = "m"})
        .add("rpy_rad", &W::rpy_rad,
             "Instead of look_at_m: roll, pitch and yaw of a camera body that looks along its x.",
             {.unit = "rad"});
  }
};

/// A camera that stands still.
struct FixedCamera {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d look_at_m = Eigen::Vector3d::Zero();

  static Parameters<FixedCamera> parameters() {
    using F = FixedCamera;
    return Parameters<F>()
        .add("position_m", &F::position_m, "Where it is, in the world frame.",
             {.unit = "m", .required = true})
        .add("look_at_m", &F::look_at_m, "A point in the world in the middle of its image.",
             {.unit = "m", .required = true});
  }
};

/// Where on the robot the camera sits.
struct MountOptions {
  std::string link;
  Eigen::Vector3d xyz_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rpy_rad = Eigen::Vector3d::Zero();

  static Parameters<MountOptions> parameters() {
    using M = MountOptions;
    return Parameters<M>()
        .add("link", &M::link, "The robot's link that carries the camera.", {.required = true})
        .add("xyz_m", &M::xyz_m,
             "Of the optical frame (z forward, y down), or a laser's, in the link's frame.",
             {.unit = "m"})
        .add("rpy_rad", &M::rpy_rad, "Roll, pitch and yaw of that frame in the link's.",
             {.unit = "rad"});
  }
};

struct NoiseOptions {
  std::string model = "none";
  double axial_scale = 1.0;
  double lateral_sigma_px = 0.8;
  double baseline_m = 0.075;
  double disparity_step_px = 0.125;
  double grazing_limit_rad = 1.4;
  double edge_jump_m = 0.1;
  double edge_dropout = 0.5;
  double random_dropout = 0.002;

  static Parameters<NoiseOptions> parameters() {
    using N = NoiseOptions;
    return Parameters<N>()
        .add("model", &N::model, "none: exact depth; kinect: as the README describes.",
             {.choices = {"none", "kinect"}})
        .add("axial_scale", &N::axial_scale, "Factor on the standard deviation along the axis.",
             {.min = 0.0})
        .add("lateral_sigma_px", &N::lateral_sigma_px,
             "Standard deviation across the axis, of a surface seen face on.",
             {.unit = "px", .min = 0.0})
        .add("baseline_m", &N::baseline_m, "Between the projector and the camera.",
             {.unit = "m", .min = 1e-3})
        .add("disparity_step_px", &N::disparity_step_px,
             "Disparity is rounded to multiples of this; 0: not at all.",
             {.unit = "px", .min = 0.0})
        .add("grazing_limit_rad", &N::grazing_limit_rad,
             "Surfaces seen farther from face on than this return nothing.",
             {.unit = "rad", .min = 0.0, .max = 1.5707963267948966})
        .add("edge_jump_m", &N::edge_jump_m,
             "Difference in depth to a neighbour that makes a pixel an edge.",
             {.unit = "m", .min = 0.0})
        .add("edge_dropout", &N::edge_dropout, "Share of edge pixels that return nothing.",
             {.min = 0.0, .max = 1.0})
        .add("random_dropout", &N::random_dropout, "Share of all pixels that return nothing.",
             {.min = 0.0, .max = 1.0});
  }
};

/// The defaults are those of the laser on the HSR's base, but for the error, which is assumed.
struct LaserOptions {
  int beams = 721;
  double from_rad = -2.35619;
  double to_rad = 2.35619;
  double sigma_m = 0.01;
  double dropout = 0.002;

  static Parameters<LaserOptions> parameters() {
    using L = LaserOptions;
    return Parameters<L>()
        .add("beams", &L::beams, "Beams of a scan.", {.min = 2, .max = 8192})
        .add("from_rad", &L::from_rad, "Of the first beam, from straight ahead, to the left.",
             {.unit = "rad", .min = -3.15, .max = 3.15})
        .add("to_rad", &L::to_rad, "Of the last beam.", {.unit = "rad", .min = -3.15, .max = 3.15})
        .add("sigma_m", &L::sigma_m, "Standard deviation along the beam.",
             {.unit = "m", .min = 0.0})
        .add("dropout", &L::dropout, "Share of the beams that return nothing.",
             {.min = 0.0, .max = 1.0});
  }
};

/// What goes wrong with the sensor, for tests of what notices it.
struct FaultOptions {
  std::string kind = "none";
  double from_s = 0.0;
  std::optional<double> until_s;
  double focal_scale = 1.1;
  Eigen::Vector3d turn_rad = {0.0873, 0.0, 0.0};

  static Parameters<FaultOptions> parameters() {
    using F = FaultOptions;
    return Parameters<F>()
        .add("kind", &F::kind,
             "none; frozen: the same frame with new stamps; blind: no return; silent: no frame; "
             "lens: frames say other focal lengths; mount: they say another orientation of the "
             "sensor; obstructed: something hangs 0.15 m before a laser.",
             {.choices = {"none", "frozen", "blind", "silent", "lens", "mount", "obstructed"}})
        .add("from_s", &F::from_s, "When it begins.", {.unit = "s", .min = 0.0})
        .add("until_s", &F::until_s, "When it ends; left out: never.", {.unit = "s", .min = 0.0})
        .add("focal_scale", &F::focal_scale, "For lens: factor on what frames say.",
             {.min = 0.1, .max = 10.0})
        .add(
            "turn_rad", &F::turn_rad,
            "For mount: what frames say it is turned by, roll, pitch and yaw in the optical frame: "
            "up, to the right, about the axis.",
            {.unit = "rad"});
  }
  [[nodiscard]] bool is_on(Stamp time) const {
    return kind != "none" && time.seconds() >= from_s && (!until_s || time.seconds() < *until_s);
  }
};

struct Options {
  std::optional<std::filesystem::path> scene;
  Node people;
  bool alone = false;
  int frames = 100;
  double rate_hz = 30.0;
  double range_min_m = 0.4;
  double range_max_m = 5.0;
  CameraOptions camera;
  std::optional<LaserOptions> laser;
  std::vector<CameraWaypoint> camera_path;
  bool camera_path_repeats = false;
  std::vector<FixedCamera> fixed_cameras;
  std::optional<MountOptions> mount;
  std::string pace = "as_fast_as_possible";
  NoiseOptions noise;
  FaultOptions fault;

  static Parameters<Options> parameters() {
    using O = Options;
    return Parameters<O>()
        .add("scene", &O::scene,
             "A scene file, or the name of one among the host's scenes; left out: that of the "
             "run's first source, where this is one of `sources`, or else room.")
        .add("people", &O::people,
             "People beside those of the scene, as its block `people` has them.")
        .add("alone", &O::alone, "Without people, and without objects that move.")
        .add("frames", &O::frames, "Frames until the stream ends; 0: it never does.", {.min = 0})
        .add("rate_hz", &O::rate_hz, "Frames a second of scene time.", {.unit = "Hz", .min = 1e-3})
        .add("range_min_m", &O::range_min_m, "Nearer surfaces return nothing.",
             {.unit = "m", .min = 0.0})
        .add("range_max_m", &O::range_max_m, "Farther surfaces return nothing.",
             {.unit = "m", .min = 0.0})
        .add("camera", &O::camera, "Intrinsics of the camera.")
        .add("laser", &O::laser,
             "Instead of a camera: a planar laser, whose frames are clouds of one point a beam, "
             "in its frame with x forward and z up.")
        .add("camera_path", &O::camera_path,
             "Where the camera goes: at least one waypoint, rested at before and after.")
        .add("camera_path_repeats", &O::camera_path_repeats,
             "Whether the camera begins anew with the first waypoint when it reaches the last.")
        .add("fixed_cameras", &O::fixed_cameras,
             "Instead of camera_path: cameras that stand still and take the frames in turn. They "
             "see the run's robot.")
        .add("mount", &O::mount, "Instead of camera_path: the camera sits on the run's robot.")
        .add("pace", &O::pace,
             "as_fast_as_possible: every frame, one after the other; clock: the newest that is due "
             "on the run's clock.",
             {.choices = {"as_fast_as_possible", "clock"}})
        .add("noise", &O::noise, "How measurements differ from the truth.")
        .add("fault", &O::fault, "What goes wrong with the sensor.");
  }
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

/// Frame k is taken at k / rate.
class FrameTiming {
 public:
  explicit FrameTiming(double rate_hz) : rate_hz_(rate_hz) {}

  [[nodiscard]] Stamp stamp(std::int64_t frame) const noexcept {
    return Stamp::from_seconds(static_cast<double>(frame) / rate_hz_);
  }

  /// The last frame that is taken at or before a time; -1 for none.
  [[nodiscard]] std::int64_t last_until(Stamp time) const noexcept {
    if (time.ns < 0) return -1;
    auto frame = static_cast<std::int64_t>(std::floor(time.seconds() * rate_hz_));
    // The quotient was rounded.
    while (stamp(frame + 1) <= time) ++frame;
    while (frame >= 0 && stamp(frame) > time) --frame;
    return frame;
  }

 private:
  double rate_hz_;
};

/// Depth cameras or a planar laser in a scene, on a path, on the robot or fixed; implements
/// GroundTruth, too. Fails with kNotFound or kConfig where the scene or the parameters are wrong.
[[nodiscard]] Result<std::unique_ptr<Source>> create_source(const Options& options,
                                                            const HostContext& context);

}  // namespace sidestep::simulator
