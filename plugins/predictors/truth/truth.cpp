#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>
#include <variant>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace {

using namespace sidestep;

struct Options {
  static Parameters<Options> parameters() { return {}; }
};

/// Between knots where an object turns or repeats its way; it is at its waypoints exactly.
constexpr double kStep_s = 0.1;

/// Objects lower than this are not there.
constexpr double kUnderground_m = -100.0;

/// How far a shape reaches from its origin.
struct Extent {
  double sideways_m = 0.0;
  double up_m = 0.0;
  double down_m = 0.0;
};

/// Points around each of which there is a ball of a radius, and which together hold a shape.
struct Balls {
  std::vector<Eigen::Vector3d> centres_m;
  double radius_m = 0.0;
};

Balls balls_around(const Shape& shape) {
  return std::visit(
      []<class Kind>(const Kind& kind) -> Balls {
        Balls balls;
        if constexpr (std::is_same_v<Kind, Box>) {
          for (int corner = 0; corner < 8; ++corner) {
            const Eigen::Vector3d side(corner & 1 ? 0.5 : -0.5, corner & 2 ? 0.5 : -0.5,
                                       corner & 4 ? 0.5 : -0.5);
            balls.centres_m.emplace_back(side.cwiseProduct(kind.size_m));
          }
        } else if constexpr (std::is_same_v<Kind, Sphere>) {
          balls = {{Eigen::Vector3d::Zero()}, kind.radius_m};
        } else if constexpr (std::is_same_v<Kind, Capsule>) {
          const Eigen::Vector3d cap_m(0.0, 0.0, 0.5 * kind.length_m);
          balls = {{cap_m, -cap_m}, kind.radius_m};
        } else if constexpr (std::is_same_v<Kind, std::shared_ptr<const Mesh>>) {
          balls.centres_m = kind->vertices_m;
        }
        return balls;
      },
      shape);
}

Extent extent_of(const Shape& shape, const Eigen::Matrix3d& rotation) {
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    const Eigen::Vector3d axis = rotation.col(2);
    const double lean = axis.head<2>().norm();
    const double up_m = 0.5 * std::abs(axis.z()) * cylinder->length_m + lean * cylinder->radius_m;
    return {0.5 * lean * cylinder->length_m + cylinder->radius_m, up_m, up_m};
  }
  const Balls balls = balls_around(shape);
  Extent extent;
  for (const Eigen::Vector3d& centre_m : balls.centres_m) {
    const Eigen::Vector3d at_m = rotation * centre_m;
    extent.sideways_m = std::max(extent.sideways_m, at_m.head<2>().norm() + balls.radius_m);
    extent.up_m = std::max(extent.up_m, at_m.z() + balls.radius_m);
    extent.down_m = std::max(extent.down_m, balls.radius_m - at_m.z());
  }
  return extent;
}

/// What moves in the true scene, where it will be.
class Truth final : public Predictor {
 public:
  explicit Truth(std::shared_ptr<const Scene> scene) : scene_(std::move(scene)) {}

  [[nodiscard]] Result<Prediction> predict(const PredictionRequest& request) override {
    const double now_s = request.tracks.stamp.seconds();
    std::vector<PredictedSet> sets;
    const std::vector<SceneObject>& objects = scene_->objects();
    for (std::size_t i = 0; i < objects.size(); ++i) {
      if (!objects[i].moves()) continue;
      PredictedSet set;
      set.track = -1 - static_cast<std::int64_t>(i);  // no tracker gives such ids
      set.bottom_m = std::numeric_limits<double>::infinity();
      set.top_m = -set.bottom_m;
      const auto end_set = [&] {
        if (!set.knots.empty()) sets.push_back(set);
        set.knots.clear();
      };
      for (const double time_s : times_s(objects[i], now_s, request.horizon_s)) {
        const Transform pose = objects[i].T_world_object(now_s + time_s);
        const Eigen::Vector3d at_m = pose.translation();
        if (at_m.z() < kUnderground_m) {  // somebody who has gone, or is to come
          end_set();
          continue;
        }
        const Extent extent = extent_of(objects[i].shape, pose.rotation());
        set.bottom_m = std::min(set.bottom_m, at_m.z() - extent.down_m);
        set.top_m = std::max(set.top_m, at_m.z() + extent.up_m);
        set.knots.push_back({time_s, at_m.head<2>(), extent.sideways_m});
      }
      end_set();
    }
    return Prediction::create(request.tracks.stamp, std::move(sets));
  }
  [[nodiscard]] PredictionSubject subject() const noexcept override {
    return PredictionSubject::kThings;
  }

 private:
  /// Of an object's knots, ascending, from 0 to the horizon.
  [[nodiscard]] static std::vector<double> times_s(const SceneObject& object, double now_s,
                                                   double horizon_s) {
    std::vector<double> times_s;
    for (double time_s = 0.0; time_s < horizon_s; time_s += kStep_s) times_s.push_back(time_s);
    times_s.push_back(std::max(0.0, horizon_s));
    for (const Waypoint& waypoint : object.waypoints) {
      const double time_s = waypoint.time_s - now_s;
      if (time_s > 0.0 && time_s < horizon_s) times_s.push_back(time_s);
    }
    std::ranges::sort(times_s);
    times_s.erase(std::unique(times_s.begin(), times_s.end()), times_s.end());
    return times_s;
  }

  std::shared_ptr<const Scene> scene_;
};

Result<std::unique_ptr<Predictor>> create(const Options&, const HostContext& context) {
  if (!context.scene) {
    return fail(ErrorCode::kUnsupported, "the true motion is known in simulation only", {},
                "use another predictor, e.g. constant_velocity");
  }
  return std::make_unique<Truth>(context.scene);
}

}  // namespace

SIDESTEP_PLUGIN(sidestep::Predictor, Options, create, "truth", "0.1.0",
                "True motion, which a simulation knows: an upper bound for predictors")
