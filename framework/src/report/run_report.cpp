#include <sidestep/report/run_report.hpp>

#include <algorithm>

namespace sidestep::report {

bool RunReport::writes(std::string_view name) const {
  if (std::ranges::find(files, name) != files.end()) return true;
  return (name.ends_with(".png") || name.ends_with(".svg")) &&
         std::ranges::any_of(pictures,
                             [&](const std::string& begin) { return name.starts_with(begin); });
}

}  // namespace sidestep::report
