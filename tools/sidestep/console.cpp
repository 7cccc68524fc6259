#include "commands.hpp"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <mutex>
#include <string>

#include <spdlog/logger.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/basic_file_sink.h>

namespace sidestep {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr auto kTerminalInterval = std::chrono::milliseconds(100);
constexpr auto kLogInterval = std::chrono::seconds(5);
constexpr double kFirstGuess_s = 2.0;
constexpr const char* kEraseLine = "\r\033[K";

/// stderr, shared by messages and the progress line.
class TerminalSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  TerminalSink() : is_terminal_(isatty(STDERR_FILENO) == 1) {}

  [[nodiscard]] bool is_terminal() const noexcept { return is_terminal_; }

  void show_line(const std::string& line) {
    const std::lock_guard lock(mutex_);
    std::fprintf(stderr, "%s%s", kEraseLine, line.c_str());
    std::fflush(stderr);
    line_shown_ = true;
  }
  void erase_line() {
    const std::lock_guard lock(mutex_);
    erase();
  }

 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    spdlog::memory_buf_t text;
    formatter_->format(message, text);
    erase();
    std::fwrite(text.data(), 1, text.size(), stderr);
  }
  void flush_() override { std::fflush(stderr); }

 private:
  void erase() {
    if (line_shown_) std::fputs(kEraseLine, stderr);
    line_shown_ = false;
  }
  bool is_terminal_;
  bool line_shown_ = false;
};

spdlog::level::level_enum spdlog_level(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug: return spdlog::level::debug;
    case LogLevel::kInfo: return spdlog::level::info;
    case LogLevel::kWarning: return spdlog::level::warn;
    case LogLevel::kError: return spdlog::level::err;
  }
  return spdlog::level::info;
}

/// How fast work of one total gets done.
struct Pace {
  std::int64_t total = 0;
  std::int64_t first_done = 0;
  std::int64_t last_done = 0;
  SteadyClock::time_point since;

  void note(std::int64_t done, std::int64_t of, SteadyClock::time_point now) {
    if (of != total || done < last_done) *this = {of, done, done, now};
    last_done = done;
  }
  /// ", 1 min 20 s left"; nothing while there is too little to go by.
  [[nodiscard]] std::string time_left(SteadyClock::time_point now) const {
    const double spent_s = std::chrono::duration<double>(now - since).count();
    if (total <= last_done || last_done <= first_done || spent_s < kFirstGuess_s) return "";
    const auto left_s = std::llround(spent_s * static_cast<double>(total - last_done) /
                                     static_cast<double>(last_done - first_done));
    const auto hours = left_s / 3600, minutes = left_s / 60 % 60, seconds = left_s % 60;
    if (hours > 0) {
      return ", " + std::to_string(hours) + " h " + std::to_string(minutes) + " min left";
    }
    return ", " + (minutes > 0 ? std::to_string(minutes) + " min " : "") + std::to_string(seconds) +
           " s left";
  }
};

std::string progress_text(std::int64_t done, std::int64_t total, std::string_view what,
                          const std::string& time_left) {
  std::string text(what);
  if (total > 0) {
    text += " " + std::to_string(done) + "/" + std::to_string(total) + " (" +
            std::to_string(100 * done / total) + " %)" + time_left;
  } else if (done > 0) {
    text += " " + std::to_string(done);
  }
  return text;
}

}  // namespace

struct Console::Impl {
  std::shared_ptr<TerminalSink> terminal = std::make_shared<TerminalSink>();
  spdlog::logger console{"console", terminal};
  std::mutex mutex;  // guards what follows
  std::unique_ptr<spdlog::logger> file;
  SteadyClock::time_point last_progress;
  std::string last_what;
  Pace pace;
};

Console::Console() : impl_(std::make_unique<Impl>()) {
  impl_->terminal->set_pattern("%l: %v");
  impl_->console.set_level(spdlog::level::info);
}
Console::~Console() { end_progress(); }

void Console::write(LogLevel level, std::string_view message) {
  const spdlog::string_view_t text(message.data(), message.size());
  impl_->console.log(spdlog_level(level), text);
  const std::lock_guard lock(impl_->mutex);
  if (impl_->file) impl_->file->log(spdlog_level(level), text);
}

Result<void> Console::open_file(const std::filesystem::path& file, bool append) {
  const std::lock_guard lock(impl_->mutex);
  try {
    auto sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(file.string(), !append);
    impl_->file = std::make_unique<spdlog::logger>("file", std::move(sink));
  } catch (const spdlog::spdlog_ex& exception) {
    return fail(ErrorCode::kIo, std::string("cannot write the log: ") + exception.what(),
                file.string());
  }
  impl_->file->set_pattern("%Y-%m-%d %H:%M:%S.%e %l: %v");
  impl_->file->set_level(spdlog::level::debug);
  impl_->file->flush_on(spdlog::level::info);
  impl_->file->set_error_handler([this, told = false](const std::string& reason) mutable {
    if (!told) impl_->console.warn("the log is not complete: {}", reason);
    told = true;
  });
  return {};
}

void Console::progress(std::int64_t done, std::int64_t total, std::string_view what) {
  const auto now = SteadyClock::now();
  std::string time_left;
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->pace.note(done, total, now);
    const bool is_new = impl_->last_what != what;
    const auto interval = impl_->terminal->is_terminal() ? SteadyClock::duration(kTerminalInterval)
                                                         : SteadyClock::duration(kLogInterval);
    if (!is_new && done != total && now - impl_->last_progress < interval) return;
    impl_->last_progress = now;
    impl_->last_what = what;
    time_left = impl_->pace.time_left(now);
  }
  const std::string text = progress_text(done, total, what, time_left);
  if (impl_->terminal->is_terminal()) {
    impl_->terminal->show_line(text);
  } else {
    write(LogLevel::kInfo, text);
  }
}

void Console::end_progress() { impl_->terminal->erase_line(); }

}  // namespace sidestep
