// A source: a depth camera that goes along a wall, 1.2 m above z = 0, and looks to and fro.

#include "pans_along_wall.hpp"

#include <cmath>
#include <optional>

#include <sidestep/geometry/scene.hpp>

namespace pans_along_wall {
namespace {

using namespace sidestep;

/// One that knows what is truly there says so: results are then measured against it.
class PansAlongWall final : public Source, public GroundTruth {
 public:
  explicit PansAlongWall(const Options& options) : options_(options), scene_(scene_of(options)) {}

  Result<std::optional<Frame>> next(const Deadline& deadline) override {
    // Here is nothing to wait for. Who waits for a camera looks at the deadline meanwhile, fails
    // with kDeadlineExceeded, and keeps what comes later for the next call.
    if (deadline.stop_requested()) return fail(ErrorCode::kCancelled, "it is to stop");
    if (next_ == options_.frames) return std::nullopt;  // the end, and so it stays
    Frame frame;
    frame.sequence = next_++;
    frame.stamp = Stamp::from_seconds(static_cast<double>(frame.sequence) / options_.rate_hz);
    // The camera's pose at the stamp, in the world of the map. A camera on the robot of the run
    // reads it from HostContext::motion, and fills in joint_positions, too.
    const double time_s = frame.stamp.seconds();
    frame.T_world_camera = transform_from_xyz_rpy({0.0, options_.speed_mps * time_s, 1.2},
                                                  {0.0, 0.0, options_.pan_rad * std::sin(time_s)}) *
                           T_forward_optical();
    frame.measurement = image(frame.T_world_camera);
    return frame;
  }

  std::optional<std::int64_t> frame_count() const override { return options_.frames; }

  const Scene& scene() const override { return scene_; }

 private:
  static Scene scene_of(const Options& options) {
    constexpr double kThick_m = 0.2, kWide_m = 1000.0;
    const Transform T_world_wall(
        Eigen::Translation3d(options.distance_m + 0.5 * kThick_m, 0.0, 0.0));
    return Scene({{"wall", Box{{kThick_m, kWide_m, kWide_m}}, {{0.0, T_world_wall}}, {}, {}}});
  }

  /// Depths are along the optical axis, whatever the angle of a pixel's ray to that.
  DepthImage image(const Transform& T_world_camera) const {
    DepthImage image{{160, 120, 138.6, 138.6, 79.5, 59.5}, {}};
    for (int v = 0; v < image.camera.height_px; ++v) {
      for (int u = 0; u < image.camera.width_px; ++u) {
        const Eigen::Vector3d ray = image.camera.unproject(u, v, 1.0);
        const double towards_wall = (T_world_camera.linear() * ray).x();
        const double depth_m = options_.distance_m / towards_wall;
        const bool returns = towards_wall > 0.0 && depth_m * ray.norm() <= options_.max_range_m;
        image.depth_m.push_back(returns ? static_cast<float>(depth_m) : 0.0F);
      }
    }
    return image;
  }

  Options options_;
  Scene scene_;
  std::int64_t next_ = 0;
};

}  // namespace

Result<std::unique_ptr<Source>> create(const Options& options, const HostContext&) {
  return std::make_unique<PansAlongWall>(options);
}

}  // namespace pans_along_wall

SIDESTEP_PLUGIN(sidestep::Source, pans_along_wall::Options, pans_along_wall::create,
                "pans_along_wall", "0.1.0",
                "A depth camera goes along a wall: an example of a plugin")
