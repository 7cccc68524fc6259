#include "process_state.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>

namespace sidestep {
namespace {

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
  // Of the others threads close and open some meanwhile.
  const StandardFiles now = standard_files();
  for (std::size_t i = 0; i < files_.size(); ++i) {
    const bool was_open = files_[i].inode != 0;
    if (was_open && (files_[i].device != now[i].device || files_[i].inode != now[i].inode)) {
      return "closes standard input, output or error";
    }
  }
  return {};
}

ProcessState::StandardFiles ProcessState::standard_files() {
  StandardFiles files{};
  for (std::size_t i = 0; i < files.size(); ++i) {
    struct stat now {};
    if (fstat(static_cast<int>(i), &now) == 0) files[i] = {now.st_dev, now.st_ino};
  }
  return files;
}

}  // namespace sidestep
