#include "views.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <unordered_set>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

constexpr double kCell_m = 0.1;
constexpr double kStep_s = 0.25;
constexpr double kMemory_s = 10.0;
/// Spheres are roomier than the body that they cover.
constexpr double kBodyShare = 0.7;
/// Of an image, at whose edges nothing need be seen.
constexpr double kUseful = 0.9;
/// The HSR's, where no frame has told.
constexpr CameraIntrinsics kXtion{640, 480, 554.38, 554.38, 319.5, 239.5};

std::int64_t cell_key(const Eigen::Vector3d& p_m) {
  const auto along = [&](int axis) {
    return static_cast<std::int64_t>(std::floor(p_m[axis] / kCell_m)) & 0x1fffff;
  };
  return along(0) << 42 | along(1) << 21 | along(2);
}

}  // namespace

Frustum::Frustum(const CameraIntrinsics& camera, double reach_m) : range_m(reach_m) {
  const auto tangent = [](double pixel, double centre, double focal) {
    return kUseful * (pixel - centre) / focal;
  };
  least = {tangent(0, camera.cx_px, camera.fx_px), tangent(0, camera.cy_px, camera.fy_px)};
  most = {tangent(camera.width_px - 1, camera.cx_px, camera.fx_px),
          tangent(camera.height_px - 1, camera.cy_px, camera.fy_px)};
}

std::vector<Place> swept_places(const GazeRequest& request, double from_s, double until_s) {
  std::vector<Place> places;
  if (request.way == nullptr) return places;
  const Trajectory& way = *request.way;
  const double last_s = std::min(until_s, way.duration_s() - request.way_from_s);
  std::vector<double> times_s{0.0};
  const double first_s = std::max(from_s, kStep_s);
  const int steps = std::max(0, static_cast<int>(std::ceil((last_s - first_s) / kStep_s)));
  for (int k = 0; k < steps; ++k) times_s.push_back(first_s + k * kStep_s);
  times_s.push_back(std::max(times_s.back(), last_s));

  const auto dof = idx(way.dof);
  std::vector<double> q(times_s.size() * dof);
  for (std::size_t k = 0; k < times_s.size(); ++k) {
    way.sample(request.way_from_s + times_s[k], std::span(q).subspan(k * dof, dof), {});
  }
  std::ranges::copy(as_span(request.state.q), q.begin());  // it may be beside its way
  const std::size_t spheres = request.robot.description().spheres.size();
  std::vector<Eigen::Vector3d> centres_m(times_s.size() * spheres);
  Scratch scratch;
  request.robot.sphere_centres(q, centres_m, scratch);
  std::unordered_set<std::int64_t> cells;
  for (std::size_t i = 0; i < centres_m.size(); ++i) {
    const bool is_new = cells.insert(cell_key(centres_m[i])).second;
    if (is_new && i >= spheres) places.push_back({centres_m[i], times_s[i / spheres]});
  }
  return places;
}

Sight::Sight(const GazeRequest& request)
    : field_(*request.field),
      eye_m_(request.head.T_world_camera(request.at, request.T_world_link).translation()) {
  const RobotDescription& robot = request.robot.description();
  for (const CollisionSphere& sphere : robot.spheres) {
    const Eigen::Vector3d centre_m = request.T_world_link[idx(sphere.link)] * sphere.centre_link_m;
    const bool is_at_eye = (centre_m - eye_m_).norm() < sphere.radius_m;
    if (request.head.carries(sphere.link) || is_at_eye) continue;
    body_.push_back({centre_m - eye_m_, kBodyShare * sphere.radius_m});
  }
}

bool Sight::reaches(const Eigen::Vector3d& p_m) const {
  return !is_hidden_by_body(p_m) && !is_hidden_in_map(p_m);
}

bool Sight::knows(const Eigen::Vector3d& p_m) const {
  double distance_m = 0.0;
  FieldStatus status{};
  field_.query({&p_m, 1}, {&distance_m, 1}, {}, {&status, 1});
  return status == FieldStatus::kKnown;
}

bool Sight::is_hidden_by_body(const Eigen::Vector3d& p_m) const {
  const Eigen::Vector3d way_m = p_m - eye_m_;
  const double squared = std::max(way_m.squaredNorm(), 1e-12);
  return std::ranges::any_of(body_, [&](const Ball& ball) {
    const double share = std::clamp(ball.from_eye_m.dot(way_m) / squared, 0.0, 1.0);
    return (ball.from_eye_m - share * way_m).squaredNorm() < ball.radius_m * ball.radius_m;
  });
}

bool Sight::is_hidden_in_map(const Eigen::Vector3d& p_m) const {
  const double voxel_m = field_.info().grid.resolution_m;
  const Eigen::Vector3d way_m = p_m - eye_m_;
  const double length_m = way_m.norm();
  for (double along_m = voxel_m; along_m < length_m - kCell_m;) {
    const Eigen::Vector3d between_m = eye_m_ + along_m / length_m * way_m;
    double distance_m = 0.0;
    FieldStatus status{};
    field_.query({&between_m, 1}, {&distance_m, 1}, {}, {&status, 1});
    const bool is_known = status == FieldStatus::kKnown;  // what is unseen hides nothing yet
    if (is_known && distance_m < 0.25 * voxel_m) return true;
    along_m += is_known ? std::max(distance_m, 0.5 * voxel_m) : voxel_m;
  }
  return false;
}

void LookedAt::note(const GazeRequest& request) {
  const CameraView* camera = request.camera;
  if (camera == nullptr || (!views_.empty() && views_.back().stamp_s >= camera->stamp_s)) return;
  views_.push_back(
      {camera->stamp_s, camera->T_world_camera.inverse(), Frustum(camera->camera, range_m_)});
  while (views_.front().stamp_s < camera->stamp_s - kMemory_s) views_.pop_front();
}

double LookedAt::age_s(const Eigen::Vector3d& p_m, Stamp now) const {
  for (auto view = views_.rbegin(); view != views_.rend(); ++view) {
    if (view->frustum.contains(view->T_camera_world * p_m)) return now.seconds() - view->stamp_s;
  }
  return std::numeric_limits<double>::infinity();
}

Directions::Directions(const GazeRequest& request, const ViewOptions& options,
                       std::span<const Place> places, std::span<const float> worths)
    : places_(places.size()) {
  const Frustum frustum(request.camera != nullptr ? request.camera->camera : kXtion,
                        options.range_m);
  const HeadDescription& head = request.head.description();
  const HeadAngles rest = request.head.rest();
  const auto spread = [](const Joint& joint, double rest_rad, int index, int count) {
    const double lower = std::max(joint.lower, rest_rad - std::numbers::pi);
    const double upper = std::min(joint.upper, rest_rad + std::numbers::pi);
    return lower + (index + 0.5) / count * (upper - lower);
  };
  angles_.push_back(request.at);
  for (int i = 0; i < options.pans; ++i) {
    for (int j = 0; j < options.tilts; ++j) {
      angles_.push_back({spread(head.pan.joint, rest.pan_rad, i, options.pans),
                         spread(head.tilt.joint, rest.tilt_rad, j, options.tilts)});
    }
  }
  shows_.resize(angles_.size() * places_);
  for (std::size_t d = 0; d < angles_.size(); ++d) {
    const Transform T_camera_world =
        request.head.T_world_camera(angles_[d], request.T_world_link).inverse();
    for (std::size_t k = 0; k < places_; ++k) {
      if (worths[k] > 0.0F && frustum.contains(T_camera_world * places[k].p_m)) {
        shows_[d * places_ + k] = 1.0F;
      }
    }
  }
}

float Directions::worth(std::size_t direction, std::span<const float> worths) const {
  const float* shown = shows_.data() + direction * places_;
  float sum = 0.0F;
  for (std::size_t k = 0; k < places_; ++k) sum += shown[k] * worths[k];
  return sum;
}

}  // namespace sidestep
