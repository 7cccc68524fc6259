#include "command_line.hpp"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <stdexcept>

#include <gtest/gtest.h>

namespace sidestep::testing {

CommandLine::CommandLine(const std::vector<std::string>& arguments) {
  std::string name = std::string(::testing::TempDir()) + "/sidestep_stdout_XXXXXX";
  const int out = mkstemp(name.data());
  out_file_ = name;
  int ends[2];
  if (out < 0 || pipe2(ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
  std::vector<std::string> all = {SIDESTEP_COMMAND};
  all.insert(all.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& argument : all) argv.push_back(argument.data());
  argv.push_back(nullptr);
  process_ = fork();
  if (process_ == 0) {
    dup2(out, STDOUT_FILENO);
    dup2(ends[1], STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(127);
  }
  close(out);
  close(ends[1]);
  error_pipe_ = ends[0];
}

CommandLine::~CommandLine() {
  if (process_ > 0) (void)wait();
  close(error_pipe_);
  std::filesystem::remove(out_file_);
}

bool CommandLine::read_more() {
  char buffer[4096];
  const ssize_t count = read(error_pipe_, buffer, sizeof buffer);
  if (count > 0) error_.append(buffer, static_cast<std::size_t>(count));
  return count > 0;
}

bool CommandLine::wait_for(const std::string& text) {
  while (error_.find(text) == std::string::npos) {
    if (!read_more()) return false;
  }
  return true;
}

void CommandLine::send(int signal) const { kill(process_, signal); }

Finished CommandLine::wait() {
  while (read_more()) {
  }
  int status = 0;
  waitpid(process_, &status, 0);
  process_ = -1;
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(out_file_), error_};
}

Finished run(const std::vector<std::string>& arguments) { return CommandLine(arguments).wait(); }

std::string read_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace sidestep::testing
