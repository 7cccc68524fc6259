#include "replan_visibility.hpp"

#include <algorithm>
#include <cmath>

#include <sidestep/core/index.hpp>
#include <sidestep/geometry/ray_caster.hpp>

namespace sidestep {
namespace {

constexpr double kSeenFor_s = 0.5;
/// Rays per side of an image: an object that none of them meets is as good as unseen.
constexpr int kRays = 64;

/// Fastest joint of the robot about a time.
double speed_at(const std::vector<TruePose>& poses, double time_s) {
  const auto after = std::ranges::lower_bound(poses, time_s, {}, &TruePose::time_s);
  if (poses.size() < 2) return 0.0;
  const auto at = std::clamp<std::ptrdiff_t>(after - poses.begin(), 1,
                                             static_cast<std::ptrdiff_t>(poses.size()) - 1);
  const TruePose& a = poses[idx(at - 1)];
  const TruePose& b = poses[idx(at)];
  return (b.q - a.q).cwiseAbs().maxCoeff() / std::max(1e-9, b.time_s - a.time_s);
}

bool shows(const CameraView& view, const RayCaster& caster, int object) {
  std::vector<Eigen::Vector3d> origins(kRays, view.T_world_camera.translation());
  std::vector<Eigen::Vector3d> directions(kRays);
  std::vector<RayHit> hits(kRays);
  for (int v = 0; v < kRays; ++v) {
    for (int u = 0; u < kRays; ++u) {
      const double column = (u + 0.5) / kRays * view.camera.width_px - 0.5;
      const double row = (v + 0.5) / kRays * view.camera.height_px - 0.5;
      directions[idx(u)] =
          view.T_world_camera.linear() * view.camera.unproject(column, row, 1.0).normalized();
    }
    caster.cast(origins, directions, hits);
    if (std::ranges::any_of(hits, [&](const RayHit& hit) { return hit.object == object; })) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::string cause_of(const TrueContact& contact, const EpisodeRecord& episode, double rest_speed) {
  if (speed_at(episode.poses, contact.begin_s) < rest_speed) return "walked into while stopped";
  if (episode.views.empty() || episode.scene == nullptr) return "unknown";
  const auto& objects = episode.scene->objects();
  const auto named = std::ranges::find(objects, contact.object, &SceneObject::name);
  if (named == objects.end()) return "unknown";
  RayCaster caster(*episode.scene);
  int seen = 0;
  for (const CameraView& view : episode.views) {
    if (view.stamp_s < contact.begin_s - kSeenFor_s || view.stamp_s > contact.begin_s) continue;
    caster.set_time(view.stamp_s);
    if (!shows(view, caster, static_cast<int>(named - objects.begin()))) return "unseen";
    ++seen;
  }
  return seen == 0 ? "unseen" : "fault";
}

}  // namespace sidestep
