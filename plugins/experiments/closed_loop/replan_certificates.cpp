#include <algorithm>

#include <sidestep/certificates/leave_certificate.hpp>
#include <sidestep/planning/shape_obstacles.hpp>
#include <sidestep/trajectory/splice.hpp>
#include "closed_loop.hpp"

namespace sidestep {

Result<void> certify_motions(const RobotModel& robot, const SpacePolicy& space,
                             const std::filesystem::path& run, EpisodeRecord& episode) {
  constexpr double kLeast_s = 1e-3;
  const auto folder = run / "certificates" / ("episode-" + std::to_string(episode.episode));
  std::int64_t& motions = episode.motions.emplace(0);
  std::int64_t& proven = episode.proven_motions.emplace(0);
  for (std::size_t i = 0; i < episode.moved.size(); ++i) {
    const FollowedPath& moved = episode.moved[i];
    const bool is_last = i + 1 == episode.moved.size();
    double end_s = moved.trajectory.duration_s();
    if (!is_last) end_s = std::min(end_s, episode.moved[i + 1].start_s - moved.start_s);
    if (end_s < kLeast_s || moved.field == nullptr) continue;
    ShapeObstacles obstacles;
    obstacles.resolution_m = moved.field->info().grid.resolution_m;
    obstacles.occupied_centres_m = occupied_centres(*moved.field, space.unknown);
    obstacles.floor = space.floor;
    const auto outcome =
        SIDESTEP_TRY(leave_certificate(robot, obstacles, {}, cut(moved.trajectory, 0.0, end_s),
                                       folder / (std::to_string(motions++) + ".json")));
    proven += outcome == Certification::Outcome::kProven ? 1 : 0;
  }
  return {};
}

}  // namespace sidestep
