#include <sidestep/certificates/leave_certificate.hpp>
#include <sidestep/planning/shape_obstacles.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "replan_episode.hpp"

namespace sidestep {

std::filesystem::path certificates_of(const ReplanConfiguration& settings,
                                      const std::filesystem::path& run, std::int64_t episode) {
  if (!settings.check.wants_certificate()) return {};
  return run / "certificates" / ("episode-" + std::to_string(episode));
}

Result<void> certify_motions(const ReplanConfiguration& settings, const RobotModel& robot,
                             const std::filesystem::path& folder, EpisodeRecord& episode) {
  constexpr double kLeast_s = 1e-3;
  episode.motions = episode.proven_motions = 0;
  for (std::size_t i = 0; i < episode.moved.size(); ++i) {
    const FollowedPath& moved = episode.moved[i];
    const bool is_last = i + 1 == episode.moved.size();
    double end_s = moved.trajectory.duration_s();
    if (!is_last) end_s = std::min(end_s, episode.moved[i + 1].start_s - moved.start_s);
    if (end_s < kLeast_s || moved.field == nullptr) continue;
    ShapeObstacles obstacles;
    obstacles.resolution_m = moved.field->info().grid.resolution_m;
    obstacles.occupied_centres_m =
        occupied_centres(*moved.field, settings.planning.space().unknown);
    obstacles.floor = settings.planning.space().floor;
    const auto outcome =
        SIDESTEP_TRY(leave_certificate(robot, obstacles, {}, cut(moved.trajectory, 0.0, end_s),
                                       folder / (std::to_string(*episode.motions) + ".json")));
    ++*episode.motions;
    *episode.proven_motions += outcome == Certification::Outcome::kProven ? 1 : 0;
  }
  return {};
}

}  // namespace sidestep
