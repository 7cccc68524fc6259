#pragma once

#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

namespace sidestep::testing {

/// What a finished `sidestep` left behind.
struct Finished {
  int exit_code = -1;  ///< -1 where a signal ended it.
  std::string out;     ///< stdout
  std::string error;   ///< stderr
};

/// A `sidestep` that is running.
class CommandLine {
 public:
  explicit CommandLine(const std::vector<std::string>& arguments);
  ~CommandLine();
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;

  /// Reads stderr until `text` has appeared in it; false if it ends before.
  bool wait_for(const std::string& text);
  void send(int signal) const;
  [[nodiscard]] Finished wait();

 private:
  bool read_more();  // of stderr

  int process_ = -1;
  int error_pipe_ = -1;
  std::filesystem::path out_file_;
  std::string error_;
};

[[nodiscard]] Finished run(const std::vector<std::string>& arguments);

/// The whole of a file; empty if it cannot be read.
[[nodiscard]] std::string read_file(const std::filesystem::path& file);

}  // namespace sidestep::testing
