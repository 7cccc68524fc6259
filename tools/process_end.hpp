#pragma once

#include <sys/wait.h>

#include <csignal>
#include <cstring>
#include <string>

namespace sidestep {

/// How a process ended that did not come to its own end, by waitpid()'s status.
inline std::string manner_of_end(int status) {
  if (WIFEXITED(status)) {
    return "ended the process with exit code " + std::to_string(WEXITSTATUS(status));
  }
  const int signal = WTERMSIG(status);
  if (signal == SIGKILL) return "killed by SIGKILL (out of memory?)";
  if (signal == SIGABRT) return "aborted (abort() or an uncaught exception)";
  return std::string("crashed (") + strsignal(signal) + ")";
}

}  // namespace sidestep
