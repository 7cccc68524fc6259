#include "jobs.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <deque>
#include <utility>

#include "process_end.hpp"

namespace sidestep {
namespace {

constexpr int kPollInterval_ms = 100;  // how soon a stop is passed on

/// A process of this program.
class Process {
 public:
  explicit Process(const Job& job) : label_(job.label) {
    std::array<int, 2> ends{-1, -1};
    if (pipe2(ends.data(), O_CLOEXEC) != 0) return;
    std::vector<std::string> words = {"sidestep"};
    words.insert(words.end(), job.arguments.begin(), job.arguments.end());
    std::vector<char*> argv;
    argv.reserve(words.size() + 1);
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    id_ = fork();
    if (id_ == 0) become(argv.data(), ends[1]);
    close(ends[1]);
    error_pipe_ = ends[0];
  }
  ~Process() {
    if (error_pipe_ >= 0) close(error_pipe_);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  [[nodiscard]] pollfd watched() const { return {error_pipe_, POLLIN, 0}; }
  [[nodiscard]] bool is_open() const { return error_pipe_ >= 0; }
  void send(int signal) const {
    if (id_ > 0) kill(id_, signal);
  }

  /// Hands over the lines that are there, blocking until there is something; at the end, closes.
  void read_lines(const std::function<void(const std::string&)>& line) {
    std::array<char, 4096> buffer{};
    const ssize_t count = read(error_pipe_, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) return;
    if (count > 0) {
      text_.append(buffer.data(), static_cast<std::size_t>(count));
    } else {
      if (!text_.empty()) text_ += '\n';
      close(std::exchange(error_pipe_, -1));
    }
    for (std::size_t end = 0; (end = text_.find('\n')) != std::string::npos;) {
      line(label_ + " " + text_.substr(0, end));
      text_.erase(0, end + 1);
    }
  }

  /// Waits for its end.
  [[nodiscard]] JobEnd end() const {
    int status = 0;
    if (id_ <= 0 || waitpid(id_, &status, 0) != id_) return {{}, "could not begin"};
    if (WIFEXITED(status)) return {WEXITSTATUS(status), ""};
    return {{}, manner_of_end(status)};
  }

 private:
  /// In the new process: in a group of its own, so that Ctrl-C is ours to pass on.
  [[noreturn]] static void become(char* const* argv, int error) {
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    const int nothing = open("/dev/null", O_RDWR | O_CLOEXEC);
    dup2(nothing, STDIN_FILENO);
    dup2(nothing, STDOUT_FILENO);
    dup2(error, STDERR_FILENO);
    execv("/proc/self/exe", argv);
    _exit(127);
  }

  std::string label_;
  std::string text_;  ///< Of a line that is not complete.
  pid_t id_ = -1;
  int error_pipe_ = -1;
};

}  // namespace

std::string shell_word(const std::string& word) {
  if (word.find_first_of(" \t\n'\"$`\\()<>|&;*?#~!{}[]") == std::string::npos) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::vector<JobEnd> run_jobs(const std::vector<Job>& jobs, int at_once, const std::stop_token& stop,
                             const std::function<void(const std::string&)>& line,
                             const std::function<void(std::size_t job, const JobEnd& end)>& ended) {
  std::vector<JobEnd> ends(jobs.size(), JobEnd{{}, "was not begun"});
  std::vector<char> has_ended(jobs.size(), 0);
  std::deque<Process> processes;  // which are not moved; as many as have begun
  int running = 0;
  for (bool told_to_stop = false;;) {
    for (; running < at_once && processes.size() < jobs.size() && !stop.stop_requested();
         ++running) {
      processes.emplace_back(jobs[processes.size()]);
    }
    if (running == 0) return ends;
    if (stop.stop_requested() && !told_to_stop) {
      for (const Process& process : processes) {
        if (process.is_open()) process.send(SIGTERM);
      }
      told_to_stop = true;
    }
    std::vector<pollfd> watched;
    std::vector<std::size_t> whose;
    for (std::size_t i = 0; i < processes.size(); ++i) {
      if (!processes[i].is_open()) continue;
      watched.push_back(processes[i].watched());
      whose.push_back(i);
    }
    if (poll(watched.data(), watched.size(), kPollInterval_ms) < 0) continue;
    for (std::size_t w = 0; w < whose.size(); ++w) {
      if (watched[w].revents != 0) processes[whose[w]].read_lines(line);
    }
    for (std::size_t i = 0; i < processes.size(); ++i) {
      if (processes[i].is_open() || has_ended[i] != 0) continue;
      ends[i] = processes[i].end();
      has_ended[i] = 1;
      --running;
      if (ended) ended(i, ends[i]);
    }
  }
}

}  // namespace sidestep
