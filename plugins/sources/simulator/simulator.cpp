#include "simulator.hpp"

#include <chrono>
#include <limits>
#include <thread>
#include <utility>

#include <sidestep/geometry/crowd.hpp>
#include <sidestep/geometry/load_scene.hpp>
#include <sidestep/geometry/ray_caster.hpp>
#include <sidestep/planning/prediction.hpp>

#include "depth_sensor.hpp"
#include "laser_scanner.hpp"
#include "viewpoint.hpp"

namespace sidestep::simulator {
namespace {

/// How often a clock that is waited for is looked at.
constexpr auto kPoll = std::chrono::microseconds(200);

CameraIntrinsics intrinsics(const CameraOptions& options) {
  return {options.width_px, options.height_px, options.fx_px,
          options.fy_px,    options.cx_px,     options.cy_px};
}

/// A scene with more objects behind its own.
Scene with_objects(const Scene& scene, const std::vector<SceneObject>& more) {
  std::vector<SceneObject> all = scene.objects();
  all.insert(all.end(), more.begin(), more.end());
  return Scene(std::move(all));
}

class Simulator final : public Source, public GroundTruth {
 public:
  Simulator(const Options& options, std::shared_ptr<const Scene> scene, Viewpoint viewpoint,
            const HostContext& context)
      : frames_(options.frames),
        is_paced_(options.pace == "clock"),
        camera_(intrinsics(options.camera)),
        scene_(std::move(scene)),
        viewpoint_(std::move(viewpoint)),
        timing_(options.rate_hz),
        clock_(context.clock),
        workers_(context.workers),
        robot_(context.robot),
        motion_(context.motion),
        caster_(with_objects(*scene_, viewpoint_.shapes())),
        fault_(options.fault),
        sensor_(camera_, {options.range_min_m, options.range_max_m}, options.noise, context.seed),
        renderer_(camera_, sensor_.needs_incidence()) {
    if (options.laser) {
      laser_.emplace(*options.laser, Range{options.range_min_m, options.range_max_m}, context.seed);
    }
    if (!options.scene) truth_ = context.truth;
    if (truth_ != nullptr) return;
    Crowd crowd(*scene_);
    if (!crowd.sees_robot()) return;
    crowd_ = std::move(crowd);
    so_far_ = scene_;
  }

  Result<std::optional<Frame>> next(const Deadline& deadline) override {
    if (!is_paced_ && !deadline.stop_requested() && !is_over() && deadline.expired()) {
      return fail(ErrorCode::kDeadlineExceeded, "no time was left to render a frame");
    }
    for (;; std::this_thread::sleep_for(kPoll)) {
      if (deadline.stop_requested()) return fail(ErrorCode::kCancelled, "rendering was cancelled");
      if (is_over()) return std::optional<Frame>();
      if (is_paced_) skip_to_newest();
      const Stamp stamp = timing_.stamp(at_);
      if (fault_.kind == "silent" && fault_.is_on(stamp) && stamp <= clock_.now()) {
        ++at_;
        if (!deadline.expired()) continue;
        return fail(ErrorCode::kDeadlineExceeded, "the sensor is silent");
      }
      if (!is_paced_ || stamp <= clock_.now()) {
        if (const auto view = viewpoint_.view(stamp, at_)) return render(*view, stamp);
      }
      // At the run's pace a newer frame may do; behind the last one there is none.
      const bool is_awaited = is_paced_ && at_ + 1 != frames_;
      if (!is_awaited && viewpoint_.is_past(stamp)) return unknown_pose(stamp);
      if (deadline.expired()) {
        return fail(ErrorCode::kDeadlineExceeded, "frame " + std::to_string(at_) + ", at " +
                                                      std::to_string(stamp.seconds()) +
                                                      " s, was not due or not known in time");
      }
    }
  }

  std::optional<std::int64_t> frame_count() const override {
    if (frames_ == 0 || is_paced_) return {};
    return frames_;
  }

  const Scene& scene() const override { return *scene_; }

  std::shared_ptr<const Scene> scene_until(Stamp time) override {
    if (!crowd_) return scene_;
    if (crowd_->advance(time.seconds(), robot_as_seen(time))) {
      so_far_ = std::make_shared<const Scene>(crowd_->scene());
    }
    return so_far_;
  }

 private:
  [[nodiscard]] bool is_over() const noexcept { return frames_ > 0 && at_ >= frames_; }

  /// Passes over the frames that have been overtaken by one that is due and whose view is known.
  void skip_to_newest() {
    std::int64_t newest = timing_.last_until(std::min(clock_.now(), viewpoint_.known_until()));
    if (frames_ > 0) newest = std::min(newest, frames_ - 1);
    at_ = std::max(at_, newest);
  }

  std::optional<Frame> render(const View& view, Stamp stamp) {
    std::optional<Frame> frame(std::in_place);
    frame->sequence = at_++;
    frame->stamp = stamp;
    frame->T_world_camera = view.T_world_camera;
    frame->joint_positions = view.joint_positions;
    place(view, stamp);
    if (laser_) {
      PointCloud scan;
      laser_->scan(caster_, view.T_world_eye, frame->sequence, scan.points_m);
      frame->measurement = std::move(scan);
    } else {
      renderer_.render(caster_, view.T_world_eye, workers_, exact_);
      DepthImage image{camera_, {}};
      sensor_.measure(exact_, frame->sequence, workers_, image.depth_m);
      frame->measurement = std::move(image);
    }
    const bool is_sound = !fault_.is_on(stamp);
    if (fault_.kind == "frozen" && (is_sound || !last_sound_)) last_sound_ = frame->measurement;
    if (!is_sound) spoil(*frame);
    return frame;
  }

  /// Everything to where it is at that time.
  void place(const View& view, Stamp stamp) {
    if (truth_ != nullptr) {
      if (auto scene = truth_->scene_until(stamp); scene != scene_) {
        scene_ = std::move(scene);
        caster_ = RayCaster(with_objects(*scene_, viewpoint_.shapes()));
      }
    }
    caster_.set_time(stamp.seconds());
    if (crowd_) {
      crowd_->advance(stamp.seconds(), robot_as_seen(stamp));
      caster_.set_poses(crowd_->first_body(), crowd_->poses(stamp.seconds()));
    }
    caster_.set_poses(scene_->objects().size(), view.T_world_shape);
  }

  void spoil(Frame& frame) const {
    auto* const image = std::get_if<DepthImage>(&frame.measurement);
    auto* const scan = std::get_if<PointCloud>(&frame.measurement);
    if (fault_.kind == "frozen") frame.measurement = *last_sound_;
    if (fault_.kind == "blind" && image != nullptr) std::ranges::fill(image->depth_m, 0.0F);
    if (fault_.kind == "blind" && scan != nullptr) {
      const float nan = std::numeric_limits<float>::quiet_NaN();
      std::ranges::fill(scan->points_m, Eigen::Vector3f::Constant(nan));
    }
    if (fault_.kind == "lens" && image != nullptr) {
      image->camera.fx_px *= fault_.focal_scale;
      image->camera.fy_px *= fault_.focal_scale;
    }
    if (fault_.kind == "mount") {
      frame.T_world_camera =
          frame.T_world_camera * transform_from_xyz_rpy(Eigen::Vector3d::Zero(), fault_.turn_rad);
    }
    if (fault_.kind == "obstructed" && scan != nullptr) hang_before(*scan);
  }

  /// A thirtieth of the beams, to the right, end at something 0.15 m away.
  void hang_before(PointCloud& scan) const {
    constexpr double kDistance_m = 0.15;
    const std::size_t beams = scan.points_m.size();
    for (std::size_t beam = beams / 3; beam < beams / 3 + beams / 30; ++beam) {
      scan.points_m[beam] = laser_->point_m(beam, kDistance_m);
    }
  }

  tl::unexpected<Error> unknown_pose(Stamp stamp) {
    return fail(ErrorCode::kBadFrame,
                "where the robot was at " + std::to_string(stamp.seconds()) + " s is not known",
                "frame " + std::to_string(at_++));
  }

  /// Where the run's robot is, as far as anybody can see it.
  [[nodiscard]] std::optional<OrcaAgent> robot_as_seen(Stamp time) const {
    if (robot_ == nullptr || motion_ == nullptr) return {};
    const auto newest = motion_->newest();
    if (!newest) return {};
    const auto state = motion_->truth(std::min(time, *newest));
    if (!state) return {};
    const RobotFootprint seen = footprint(*robot_, *state);
    return OrcaAgent{seen.position_m, seen.velocity_mps, seen.radius_m};
  }

  std::int64_t frames_;
  bool is_paced_;
  CameraIntrinsics camera_;
  std::shared_ptr<const Scene> scene_;
  Viewpoint viewpoint_;
  FrameTiming timing_;
  const Clock& clock_;
  WorkerPool& workers_;
  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<RobotMotion> motion_;
  std::optional<Crowd> crowd_;           ///< Where people see the robot.
  std::shared_ptr<const Scene> so_far_;  ///< With their ways.
  RayCaster caster_;
  FaultOptions fault_;
  /// Before a fault that repeats it.
  std::optional<std::variant<DepthImage, PointCloud>> last_sound_;
  DepthSensor sensor_;
  DepthRenderer renderer_;
  ExactImage exact_;
  std::optional<LaserScanner> laser_;  ///< Instead of the camera.
  GroundTruth* truth_ = nullptr;       ///< Of the run's first source, beside which this one is.
  std::int64_t at_ = 0;
};

}  // namespace

std::vector<OptionMistake> Options::check() const {
  std::vector<OptionMistake> mistakes;
  if (!mount) {
    mistakes =
        fixed_cameras.empty() ? check_camera_path(camera_path) : check_fixed_cameras(fixed_cameras);
  }
  const auto exclude = [&](bool both, const std::string& one, const std::string& other) {
    if (both) mistakes.push_back({{one, other}, "and " + other + " exclude each other", {}});
  };
  exclude(mount && !camera_path.empty(), "mount", "camera_path");
  exclude(mount && !fixed_cameras.empty(), "mount", "fixed_cameras");
  exclude(!fixed_cameras.empty() && !camera_path.empty(), "fixed_cameras", "camera_path");
  if (fault.kind == (laser ? "lens" : "obstructed")) {
    mistakes.push_back({{"fault.kind"}, laser ? "is of cameras" : "is of lasers", {}});
  }
  if (laser && laser->from_rad >= laser->to_rad) {
    mistakes.push_back({{"laser.from_rad", "laser.to_rad"}, "must be less than to_rad", {}});
  }
  if (range_min_m >= range_max_m) {
    mistakes.push_back({{"range_min_m", "range_max_m"}, "must be less than range_max_m", {}});
  }
  return mistakes;
}

/// The scene of the options for one seed, with all ways that people walk whatever the robot does.
Result<Scene> scene_of(const Options& options, const HostContext& context) {
  const std::filesystem::path name = options.scene.value_or("room");
  Scene scene = SIDESTEP_TRY(load_scene(name, context.scene_paths, context.documents));
  const auto moving = std::ranges::count_if(scene.objects(), &SceneObject::moves);
  context.log.debug("read scene " + name.string() + ": " + std::to_string(scene.objects().size()) +
                    " objects, " + std::to_string(moving) + " of them moving, " +
                    std::to_string(scene.people().groups.size()) + " groups of people, " +
                    std::to_string(scene.people().persons.size()) + " recorded people");
  if (options.alone) {
    std::vector<SceneObject> standing = scene.objects();
    std::erase_if(standing, [](const SceneObject& object) { return object.moves(); });
    return Scene(std::move(standing));
  }
  if (!options.people.is_null()) {
    std::vector<Error> errors;
    People people = read_people(options.people, errors);
    if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
    const People& its = scene.people();
    people.groups.insert(people.groups.begin(), its.groups.begin(), its.groups.end());
    people.persons.insert(people.persons.begin(), its.persons.begin(), its.persons.end());
    scene = Scene(scene.objects(), std::move(people));
  }
  Scene drawn = SIDESTEP_TRY(scene.drawn(context.seed));
  return Crowd(drawn).sees_robot() ? std::move(drawn) : walked(drawn);
}

Result<std::unique_ptr<Source>> create_source(const Options& options, const HostContext& context) {
  std::shared_ptr<const Scene> scene = context.scene;
  if (options.scene || context.truth == nullptr) {
    scene = std::make_shared<const Scene>(SIDESTEP_TRY(scene_of(options, context)));
  }
  auto viewpoint = SIDESTEP_TRY(Viewpoint::create(options, context));
  return std::unique_ptr<Source>(
      std::make_unique<Simulator>(options, std::move(scene), std::move(viewpoint), context));
}

}  // namespace sidestep::simulator
