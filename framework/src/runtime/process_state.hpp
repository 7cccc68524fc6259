#pragma once

#include <sys/resource.h>
#include <sys/time.h>
#include <sys/types.h>

#include <array>
#include <csignal>
#include <string>
#include <vector>

namespace sidestep {

/// What a library that is opened may change for the whole process: timers, limits, blocked signals,
/// open files.
class ProcessState {
 public:
  ProcessState();

  /// Puts back what can be put back; what can not, in words: empty where all is as it was. In a
  /// copy of the process, which the library has made, does not return.
  [[nodiscard]] std::string restore() const;

 private:
  struct OpenFile {
    int number;
    dev_t device;
    ino_t inode;
  };
  [[nodiscard]] static std::vector<OpenFile> open_files();

  pid_t process_;
  std::array<itimerval, 3> timers_{};
  std::array<rlimit, RLIM_NLIMITS> limits_{};
  sigset_t blocked_{};
  std::vector<OpenFile> files_ = open_files();
};

}  // namespace sidestep
