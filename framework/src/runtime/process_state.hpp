#pragma once

#include <sys/resource.h>
#include <sys/time.h>
#include <sys/types.h>

#include <array>
#include <csignal>
#include <string>

namespace sidestep {

/// What a library that is opened may change for the whole process: timers, limits, blocked signals,
/// standard input and output.
class ProcessState {
 public:
  ProcessState();

  /// Puts back what can be put back; what can not, in words: empty where all is as it was. In a
  /// copy of the process, which the library has made, does not return.
  [[nodiscard]] std::string restore() const;

 private:
  /// Which file it is that is open there; zeroes where none is.
  struct OpenFile {
    dev_t device;
    ino_t inode;
  };
  using StandardFiles = std::array<OpenFile, 3>;
  [[nodiscard]] static StandardFiles standard_files();

  pid_t process_;
  std::array<itimerval, 3> timers_{};
  std::array<rlimit, RLIM_NLIMITS> limits_{};
  sigset_t blocked_{};
  StandardFiles files_ = standard_files();
};

}  // namespace sidestep
