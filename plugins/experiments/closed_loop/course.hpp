#pragma once

#include <optional>

#include <sidestep/report/report_parts.hpp>
#include "replan_rows.hpp"

namespace sidestep {

/// How near the robot came to anything over an episode, and how fast base and hand went: of each
/// time its seconds, m, m/s and m/s; nothing where the truth is not known.
[[nodiscard]] StoredArray course_of(const EpisodeRecord& episode, const RobotModel& robot);

/// The same, drawn, with the contacts of the episode; nothing where nothing was stored.
[[nodiscard]] std::optional<Figure> course_figure(const StoredArray& course, std::int64_t episode,
                                                  const report::Json& collisions);

}  // namespace sidestep
