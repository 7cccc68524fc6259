#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

namespace sidestep {

/// As a shell takes it for one word. [any]
[[nodiscard]] std::string shell_word(const std::string& word);

/// A `sidestep` of its own, by its arguments.
struct Job {
  std::string label;  ///< Before each line that it writes.
  std::vector<std::string> arguments;
};

/// How it ended.
struct JobEnd {
  std::optional<int> code;  ///< Its exit code; nothing where it has none.
  std::string fault;        ///< Why not: a signal ended it, or it did not begin.
};

/// Runs all jobs, in their order and `at_once` of them at a time, each in a process of its own, and
/// hands over their lines of stderr; what they write to stdout is lost. A stop that is requested is
/// passed on to those that run, once, and no other begins; none outlives this process. `ended`, if
/// there is one, is called as each has ended. [main]
[[nodiscard]] std::vector<JobEnd> run_jobs(
    const std::vector<Job>& jobs, int at_once, const std::stop_token& stop,
    const std::function<void(const std::string&)>& line,
    const std::function<void(std::size_t job, const JobEnd& end)>& ended = {});

}  // namespace sidestep
