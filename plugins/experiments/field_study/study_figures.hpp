#pragma once

#include <vector>

#include <sidestep/report/canvas.hpp>
#include "study_rows.hpp"

namespace sidestep {

/// The pictures of a field study, a panel for each robot: failures against obstacle size, the
/// distributions of iterations and of valid costs, cost against cost.
[[nodiscard]] std::vector<Figure> study_figures(const StudyRecord& study);

}  // namespace sidestep
