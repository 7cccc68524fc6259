#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <vector>

namespace sidestep {

/// A `sidestep` of its own, by its arguments.
struct Job {
  std::string label;  ///< Before each line that it writes.
  std::vector<std::string> arguments;
};

/// Runs all jobs at once, each in a process of its own, and hands over their lines of stderr; what
/// they write to stdout is lost. A stop that is requested is passed on to all of them, once; none
/// outlives this process. Returns their exit codes, -1 where a signal ended one or it could not
/// begin. [main]
[[nodiscard]] std::vector<int> run_jobs(const std::vector<Job>& jobs, const std::stop_token& stop,
                                        const std::function<void(const std::string&)>& line);

}  // namespace sidestep
