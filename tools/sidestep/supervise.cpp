#include "supervise.hpp"

#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <set>
#include <string>
#include <string_view>

#include <sidestep/core/error.hpp>
#include <sidestep/core/plugin_calls.hpp>
#include <sidestep/plugin/plugin.hpp>
#include <sidestep/runtime/install_layout.hpp>

#include "commands.hpp"
#include "process_end.hpp"

namespace sidestep {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::int64_t kLongestOpening_ns = 20 * kSecond_ns;
constexpr std::int64_t kLongestExit_ns = 10 * kSecond_ns;  ///< After the command's own end.
constexpr std::int64_t kPatience_ns = 2 * kSecond_ns;  ///< After Ctrl-C, before somebody is named.

constexpr std::string_view kExperiment = "experiment ";
/// Where nothing says that a plugin ended the process.
constexpr const char* kNobody = "Sidestep";

/// Whether this is to be one process: a sanitizer has things to say as it ends, by its exit code.
bool is_alone() {
  const char* const wanted = std::getenv("SIDESTEP_SUPERVISE");
  if (wanted != nullptr && std::string_view(wanted) == "0") return true;
  if (std::string_view(detail::kSanitizer) != "none") return true;
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("TracerPid:")) return std::strtol(line.c_str() + 10, nullptr, 10) != 0;
  }
  return false;
}

/// The innermost plugin that a thread has been in since before a time; empty where there is none.
std::string plugin_of(const PluginBoard::Thread& thread, std::int64_t before_ns) {
  int depth = std::min(thread.depth.load(), static_cast<int>(thread.calls.size()));
  for (; depth > 0; --depth) {
    const PluginBoard::Call& call = thread.calls[static_cast<std::size_t>(depth) - 1];
    if (call.since_ns < before_ns) return std::string(call.plugin.view());
  }
  return "";
}

/// E.g. "optimiser ompl or optimiser gp_chain", of all threads. Experiments, which call the others,
/// are left out.
std::string plugins_on(const PluginBoard& board, std::int64_t before_ns) {
  std::set<std::string> plugins;
  for (const PluginBoard::Thread& thread : board.threads) {
    if (std::string plugin = plugin_of(thread, before_ns); !plugin.starts_with(kExperiment)) {
      plugins.insert(std::move(plugin));
    }
  }
  plugins.erase("");
  std::string text;
  for (const std::string& plugin : plugins) text += (text.empty() ? "" : " or ") + plugin;
  return text;
}

/// E.g. "plugin.so, from elsewhere", of those that the installation does not hold.
std::string foreign_libraries(const PluginBoard& board) {
  const std::string last(board.last_foreign.view());
  if (board.foreign_count == 1) return last + ", from elsewhere";
  return "what is from elsewhere, " + std::to_string(board.foreign_count) +
         " libraries, of which the last is " + last;
}

bool is_fault(int signal) {
  constexpr int kFaults[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGKILL, SIGTRAP, SIGSYS};
  return std::ranges::find(kFaults, signal) != std::end(kFaults);
}

/// The error that the end of such a process is: a plugin's, where the thread that ended it is known
/// to have been in one, or nothing is known of it.
Error error_of_end(const PluginBoard& board, int status) {
  Error error{ErrorCode::kInternal, manner_of_end(status), kNobody, {}, nullptr};
  const std::int64_t now_ns = board_time_ns();
  const int faulty = board.faulty;
  const std::string own =
      faulty > 0 ? plugin_of(board.threads[static_cast<std::size_t>(faulty) - 1], now_ns) : "";
  const std::string all = plugins_on(board, now_ns);
  if (!board.opening.view().empty()) {
    error.code = ErrorCode::kPlugin;
    error.where = board.opening.view();
  } else if (own.starts_with(kExperiment)) {  // or what it uses
    error.where = own;
  } else if (!own.empty() || (faulty == 0 && !all.empty())) {
    error.code = ErrorCode::kPlugin;
    error.where = "plugin " + (own.empty() ? all : own);
  } else if (!all.empty()) {
    error.message += ", while others were in " + all;
  }
  if (error.where == kNobody && board.foreign_count > 0) {
    error.message += "; opened was " + foreign_libraries(board);
  }
  if (const std::int64_t frames = board.frames; frames > 0) {
    error.message += "; the last frame was " + std::to_string(frames - 1);
  }
  if (!board.run.view().empty()) {
    error.hint = "what was measured is in " + std::string(board.run.view());
  }
  return error;
}

const char* line_begin() { return isatty(STDERR_FILENO) == 1 ? "\r\033[K" : ""; }

/// On stderr and in the log of the run.
void tell(const Error& error, const PluginBoard& board) {
  std::fprintf(stderr, "%serror: %s\n", line_begin(), error.describe().c_str());
  if (board.run.view().empty()) return;
  std::ofstream log(std::filesystem::path(board.run.view()).parent_path() / "run.log",
                    std::ios::app);
  log << "error: " << error.describe() << "\n";
}

/// What ended the process, in words.
std::string manner_of(const PluginBoard& board, int status) {
  return board.harm.view().empty() ? manner_of_end(status) : std::string(board.harm.view());
}

/// Refuses the library that ended the process, or all that may have; false where that does not
/// help.
bool begins_anew(PluginBoard& board, int status, bool hung_opening, const Error& error) {
  if (!board.run.view().empty()) return false;
  const std::filesystem::path opening(board.opening.view());
  if (opening.empty() && error.where != kNobody) return false;
  // What the installation holds ends nothing by itself: a thread of what was opened before did.
  const bool is_known = !opening.empty() && (board.foreign_count == 0 || board.refuses_foreign ||
                                             opening.parent_path() != install_layout().plugins);
  const auto count = static_cast<std::size_t>(board.refusal_count);
  if (is_known && count < board.refusals.size()) {
    board.refusals[count].library.set(opening.native());
    board.refusals[count].reason.set(
        hung_opening ? "takes more than 20 s to be opened (SIDESTEP_SUPERVISE=0 waits)"
                     : manner_of(board, status) + " as it was opened");
    ++board.refusal_count;
    return true;
  }
  if (board.foreign_count == 0 || board.refuses_foreign) return false;
  board.refuses_foreign = true;
  std::fprintf(stderr, "%swarning: left out is %s: the command %s\n", line_begin(),
               foreign_libraries(board).c_str(), manner_of(board, status).c_str());
  return true;
}

[[noreturn]] void end_by(int signal) {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, signal);
  std::signal(signal, SIG_DFL);
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
  std::raise(signal);
  std::_Exit(128 + signal);
}

/// Waits for the process that runs the command, and passes on what it is told meanwhile.
class Supervisor {
 public:
  Supervisor(PluginBoard& board, const sigset_t& signals) : board_(board), signals_(signals) {}

  /// The status of its end.
  int wait_for(pid_t process) {
    process_ = process;
    hung_opening_ = false;
    const timespec interval{0, kSecond_ns / 10};
    for (int status = 0;;) {
      siginfo_t heard{};
      const int signal = sigtimedwait(&signals_, &heard, &interval);
      if (signal == SIGINT || signal == SIGTERM) hear(signal, heard);
      const pid_t ended = waitpid(process_, &status, WNOHANG);
      if (ended == process_ || (ended < 0 && errno != EINTR)) return status;
      look(board_time_ns());
    }
  }
  /// Whether the process was ended since a library did not come back from being opened.
  [[nodiscard]] bool hung_opening() const noexcept { return hung_opening_; }
  /// The first signal that was to end the command, or 0.
  [[nodiscard]] int told() const noexcept { return told_; }

 private:
  void hear(int signal, const siginfo_t& heard) {
    if (heard.si_code == SI_USER && heard.si_pid == process_) {
      board_.harm.set("sends signals to other processes");
      kill(process_, SIGKILL);
      return;
    }
    if (heard.si_code != SI_KERNEL) kill(process_, signal);  // a terminal tells both
    if (told_ == 0) told_ns_ = board_time_ns();
    if (told_ == 0) told_ = signal;
  }
  void look(std::int64_t now_ns) {
    if (board_.has_ended) {
      if (ended_ns_ == 0) ended_ns_ = now_ns;
      if (now_ns - ended_ns_ > kLongestExit_ns) kill(process_, SIGKILL);
      return;
    }
    const std::int64_t opening_ns = board_.opening_since_ns;
    const bool is_told = told_ != 0 && now_ns - told_ns_ > kPatience_ns;
    if (opening_ns > 0 && now_ns - opening_ns > (is_told ? kPatience_ns : kLongestOpening_ns)) {
      hung_opening_ = true;
      kill(process_, SIGKILL);
    }
    if (!is_told || has_named_) return;
    const std::string plugins = plugins_on(board_, told_ns_);
    if (plugins.empty()) return;
    has_named_ = true;
    std::fprintf(stderr, "%swaiting for plugin %s; a second Ctrl-C ends at once\n", line_begin(),
                 plugins.c_str());
  }

  PluginBoard& board_;
  const sigset_t& signals_;
  pid_t process_ = -1;
  int told_ = 0;
  std::int64_t told_ns_ = 0;
  std::int64_t ended_ns_ = 0;
  bool has_named_ = false;
  bool hung_opening_ = false;
};

}  // namespace

int supervise(int (*command)(int, char**), int argc, char** argv) {
  PluginBoard* const board = is_alone() ? nullptr : share_plugin_board();
  if (board == nullptr) return command(argc, argv);
  sigset_t signals, before;
  sigemptyset(&signals);
  for (const int signal : {SIGCHLD, SIGINT, SIGTERM}) sigaddset(&signals, signal);
  pthread_sigmask(SIG_BLOCK, &signals, &before);
  std::signal(SIGCHLD, SIG_DFL);  // ignored, nobody would be told how the child ended
  Supervisor supervisor(*board, signals);
  board->is_watched = true;
  for (;;) {
    const pid_t parent = getpid(), process = fork();
    if (process <= 0) pthread_sigmask(SIG_SETMASK, &before, nullptr);
    if (process < 0) return command(argc, argv);
    if (process == 0) {
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      if (getppid() != parent) std::_Exit(static_cast<int>(ExitCode::kFault));
      const int code = command(argc, argv);
      std::fflush(nullptr);
      board->exit_code = code;
      board->has_ended = true;
      return code;
    }
    const int status = supervisor.wait_for(process);
    if (board->has_ended) return board->exit_code;
    if (board->harm.view().empty() && WIFSIGNALED(status) && !is_fault(WTERMSIG(status))) {
      end_by(WTERMSIG(status));
    }
    if (supervisor.hung_opening() && supervisor.told() != 0) end_by(supervisor.told());
    const Error error = error_of_end(*board, status);
    if (!begins_anew(*board, status, supervisor.hung_opening(), error)) {
      tell(error, *board);
      return static_cast<int>(exit_code(error));
    }
    board->forget_calls();
  }
}

}  // namespace sidestep
