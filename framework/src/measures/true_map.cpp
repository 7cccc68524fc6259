#include <sidestep/measures/true_map.hpp>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <optional>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/field/scene_field.hpp>

namespace sidestep {
namespace {

constexpr double kShort_s = 1e-4;          ///< For velocities.
constexpr double kSure = 1e-6;             ///< Variances of what is known exactly.
constexpr double kUnderground_m = -100.0;  ///< Where those are who are not there.
constexpr double kStands_s = 1.0;          ///< What has not moved for so long is an obstacle.

/// The upright cylinder around a shape as it stands; nothing for what has no end.
std::optional<Track> cylinder_around(const Shape& shape, const Transform& T_world_shape) {
  if (std::holds_alternative<HalfSpace>(shape)) return {};
  const auto* shared = std::get_if<std::shared_ptr<const Mesh>>(&shape);
  const Mesh own = shared == nullptr ? triangulate(shape) : Mesh{};
  const Mesh& mesh = shared == nullptr ? own : **shared;
  Track track;
  track.position_m = T_world_shape.translation().head<2>();
  track.bottom_m = kInfinity;
  track.top_m = -kInfinity;
  for (const Eigen::Vector3d& vertex : mesh.vertices_m) {
    const Eigen::Vector3d p = T_world_shape * vertex;
    track.radius_m = std::max(track.radius_m, (p.head<2>() - track.position_m).norm());
    track.bottom_m = std::min(track.bottom_m, p.z());
    track.top_m = std::max(track.top_m, p.z());
  }
  return track;
}

/// Grows a track by what another one covers.
void include(const Track& other, Track& track) {
  track.radius_m =
      std::max(track.radius_m, (other.position_m - track.position_m).norm() + other.radius_m);
  track.bottom_m = std::min(track.bottom_m, other.bottom_m);
  track.top_m = std::max(track.top_m, other.top_m);
}

}  // namespace

TrueMap true_map(const Scene& scene, Stamp time, const Eigen::AlignedBox3d& bounds_m,
                 bool masks_tracks) {
  const double now_s = time.seconds();
  std::vector<SceneObject> standing;
  auto tracks = std::make_shared<Tracks>();
  tracks->stamp = time;
  const std::int64_t others = std::ssize(scene.people().persons) + 1;
  for (std::size_t i = 0; i < scene.objects().size(); ++i) {
    const SceneObject& object = scene.objects()[i];
    if (!object.moves() && object.person < 0) {
      // Robots stand on the floor; planning.floor says which of their links keep off it.
      if (!std::holds_alternative<HalfSpace>(object.shape)) standing.push_back(object);
      continue;
    }
    const Transform now = object.T_world_object(now_s);
    if (now.translation().z() < kUnderground_m) continue;
    auto found = cylinder_around(object.shape, now);
    if (!found) continue;
    const auto is_here = [&](double time_s) {
      return object.T_world_object(time_s).matrix() == now.matrix();
    };
    const bool stands =
        is_here(now_s - kStands_s) && is_here(now_s - 0.5 * kStands_s) && is_here(now_s + kShort_s);
    if (stands || !masks_tracks) {
      SceneObject there = object;
      there.person = -1;
      there.waypoints = {{0.0, now}};
      standing.push_back(std::move(there));
    }
    if (stands) continue;
    const std::int64_t id =
        object.person >= 0 ? object.person + 1 : others + static_cast<std::int64_t>(i);
    if (!tracks->tracks.empty() && tracks->tracks.back().id == id) {
      include(*found, tracks->tracks.back());
      continue;
    }
    found->id = id;
    found->velocity_mps =
        (object.T_world_object(now_s + kShort_s).translation() - now.translation()).head<2>() /
        kShort_s;
    found->covariance = kSure * Eigen::Matrix4d::Identity();
    found->last_seen = time;
    tracks->tracks.push_back(*found);
  }
  std::ranges::sort(tracks->tracks, {}, &Track::id);
  return {std::move(tracks),
          std::make_shared<SceneField>(Scene(std::move(standing)), time, bounds_m)};
}

}  // namespace sidestep
