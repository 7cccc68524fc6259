#pragma once

#include "replan_types.hpp"

namespace sidestep {

/// The cause of a contact: "walked into while stopped" where no joint moved faster than
/// `rest_speed`; "unseen" where not every frame of the half second before shows the object, the
/// robot's own body aside; "unknown" where no depth image was kept; else "fault".
[[nodiscard]] std::string cause_of(const TrueContact& contact, const EpisodeRecord& episode,
                                   double rest_speed);

}  // namespace sidestep
