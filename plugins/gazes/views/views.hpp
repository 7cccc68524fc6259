#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/planning/gaze.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep {

/// What gazes that weigh views have in common. Their options derive from it.
struct ViewOptions {
  double horizon_s = 10.0;
  double stale_s = 5.0;
  double range_m = 4.5;
  int pans = 16;
  int tilts = 9;
};

/// The parameters of a gaze's options that are those of ViewOptions.
template <class Options>
[[nodiscard]] Parameters<Options> declare_views() {
  return Parameters<Options>()
      .add("horizon_s", &Options::horizon_s, "What the robot sweeps until then counts.",
           {.unit = "s", .min = 0.1, .max = 60.0})
      .add("stale_s", &Options::stale_s,
           "After so long what was seen is to be seen again; a time constant where it is weighed.",
           {.unit = "s", .min = 0.1, .max = 600.0})
      .add("range_m", &Options::range_m, "How far the camera sees.",
           {.unit = "m", .min = 0.1, .max = 100.0})
      .add("pans", &Options::pans, "Directions of the pan joint.", {.min = 1, .max = 64})
      .add("tilts", &Options::tilts, "Directions of the tilt joint.", {.min = 1, .max = 64});
}

/// What a camera sees of the world, but for what hides it.
struct Frustum {
  Eigen::Vector2d least = Eigen::Vector2d::Zero();  ///< Tangents of its edges, x right, y down.
  Eigen::Vector2d most = Eigen::Vector2d::Zero();
  double range_m = 0.0;

  Frustum(const CameraIntrinsics& camera, double range_m);
  /// Whether a point of the camera's optical frame is in it.
  [[nodiscard]] bool contains(const Eigen::Vector3d& p_camera) const noexcept {
    const double z = p_camera.z();
    return z > 0.0 && p_camera.x() > least.x() * z && p_camera.x() < most.x() * z &&
           p_camera.y() > least.y() * z && p_camera.y() < most.y() * z &&
           p_camera.squaredNorm() < range_m * range_m;
  }
};

/// A place worth a look. World frame.
struct Place {
  Eigen::Vector3d p_m = Eigen::Vector3d::Zero();
  double time_s = 0.0;  ///< When something of the robot is there, from now on.
};

/// The places that the centres of the robot's spheres are going to be in along the request's way,
/// from `from_s` to `until_s` after now, and are not now: one for each cell of 0.1 m, with the
/// first time. By time, ascending; none where there is no way.
[[nodiscard]] std::vector<Place> swept_places(const GazeRequest& request, double from_s,
                                              double until_s);

/// What the camera of a request could see if it looked there: nothing in the map hides it, nor does
/// the robot's own body, of which the head is no part. The request holds meanwhile, and has a map.
class Sight {
 public:
  explicit Sight(const GazeRequest& request);
  [[nodiscard]] bool reaches(const Eigen::Vector3d& p_m) const;
  /// Whether a frame has shown what is at a point.
  [[nodiscard]] bool knows(const Eigen::Vector3d& p_m) const;

 private:
  [[nodiscard]] bool is_hidden_by_body(const Eigen::Vector3d& p_m) const;
  [[nodiscard]] bool is_hidden_in_map(const Eigen::Vector3d& p_m) const;

  struct Ball {
    Eigen::Vector3d from_eye_m;
    double radius_m;
  };
  const DistanceField& field_;
  Eigen::Vector3d eye_m_;
  std::vector<Ball> body_;
};

/// Where a camera has looked lately.
class LookedAt {
 public:
  explicit LookedAt(double range_m) : range_m_(range_m) {}
  /// Takes down the view of the request's map, once.
  void note(const GazeRequest& request);
  /// How long ago a point was last in view; infinite where it was not for ten seconds.
  [[nodiscard]] double age_s(const Eigen::Vector3d& p_m, Stamp now) const;

 private:
  struct View {
    double stamp_s;
    Transform T_camera_world;
    Frustum frustum;
  };
  double range_m_;
  std::deque<View> views_;
};

/// A grid of directions of a head over its limits, and what each shows; the first is where the head
/// is.
class Directions {
 public:
  /// Of places of no worth nothing is told.
  Directions(const GazeRequest& request, const ViewOptions& options, std::span<const Place> places,
             std::span<const float> worths);

  [[nodiscard]] std::size_t size() const noexcept { return angles_.size(); }
  [[nodiscard]] const HeadAngles& angles(std::size_t direction) const { return angles_[direction]; }
  /// The sum of what the places are worth that a direction shows.
  [[nodiscard]] float worth(std::size_t direction, std::span<const float> worths) const;
  /// Whether a direction shows a place.
  [[nodiscard]] bool shows(std::size_t direction, std::size_t place) const {
    return shows_[direction * places_ + place] > 0.0F;
  }

 private:
  std::size_t places_;
  std::vector<HeadAngles> angles_;
  std::vector<float> shows_;  ///< 1 or 0, direction by direction.
};

}  // namespace sidestep
