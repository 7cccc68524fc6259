#include "process_state.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>

namespace sidestep {
namespace {

constexpr int kFiles = 3;  ///< The standard ones: threads close and open others meanwhile.
constexpr int kTimers[] = {ITIMER_REAL, ITIMER_VIRTUAL, ITIMER_PROF};

bool is_same(const rlimit& a, const rlimit& b) {
  return a.rlim_cur == b.rlim_cur && a.rlim_max == b.rlim_max;
}

}  // namespace

ProcessState::ProcessState() : process_(getpid()) {
  for (const int timer : kTimers) getitimer(timer, &timers_[static_cast<std::size_t>(timer)]);
  for (std::size_t limit = 0; limit < limits_.size(); ++limit) {
    getrlimit(static_cast<__rlimit_resource_t>(limit), &limits_[limit]);
  }
  pthread_sigmask(SIG_SETMASK, nullptr, &blocked_);
}

std::string ProcessState::restore() const {
  if (getpid() != process_) std::_Exit(0);
  for (const int timer : kTimers) {
    setitimer(timer, &timers_[static_cast<std::size_t>(timer)], nullptr);
  }
  pthread_sigmask(SIG_SETMASK, &blocked_, nullptr);
  for (std::size_t limit = 0; limit < limits_.size(); ++limit) {
    const auto which = static_cast<__rlimit_resource_t>(limit);
    rlimit now{};
    getrlimit(which, &now);
    if (!is_same(now, limits_[limit]) && setrlimit(which, &limits_[limit]) != 0) {
      return "lowers a limit of the whole process";
    }
  }
  for (const OpenFile& file : files_) {
    struct stat now {};
    if (fstat(file.number, &now) != 0 || now.st_dev != file.device || now.st_ino != file.inode) {
      return "closes standard input, output or error";
    }
  }
  return {};
}

std::vector<ProcessState::OpenFile> ProcessState::open_files() {
  std::vector<OpenFile> files;
  for (int number = 0; number < kFiles; ++number) {
    struct stat now {};
    if (fstat(number, &now) == 0) files.push_back({number, now.st_dev, now.st_ino});
  }
  return files;
}

}  // namespace sidestep
