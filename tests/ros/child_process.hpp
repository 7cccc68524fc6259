#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>

namespace sidestep::testing {

/// A program that a test runs beside itself, leader of a process group of its own. It ends with
/// the test, however that ends: the destructor kills the group, and where the test itself is killed
/// the kernel kills the program (PR_SET_PDEATHSIG).
class ChildProcess {
 public:
  /// stdout and stderr go to `log`; `environment` over the test's own.
  ChildProcess(const std::vector<std::string>& command,
               const std::map<std::string, std::string>& environment, std::filesystem::path log);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  void send(int signal) const;
  /// Its exit code, or minus the signal that ended it; nothing where it still runs.
  [[nodiscard]] std::optional<int> poll();
  /// The same, waiting for so long.
  [[nodiscard]] std::optional<int> wait(double patience_s);
  /// Whether its log has come to hold `text` within so long; false, too, where it ends before.
  [[nodiscard]] bool says(const std::string& text, double patience_s);
  [[nodiscard]] std::string log() const;

 private:
  pid_t process_ = -1;
  std::optional<int> ended_;
  std::filesystem::path log_;
};

/// A TCP port of the loopback interface that nobody listens on.
[[nodiscard]] int free_port();

}  // namespace sidestep::testing
