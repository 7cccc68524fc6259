#include "console.hpp"

#include <unistd.h>

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

std::string progress_text(std::int64_t done, std::int64_t total, std::string_view what) {
  std::string text(what);
  if (total > 0) {
    text += " " + std::to_string(done) + "/" + std::to_string(total) + " (" +
            std::to_string(100 * done / total) + " %)";
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

Result<void> Console::open_file(const std::filesystem::path& file) {
  const std::lock_guard lock(impl_->mutex);
  try {
    auto sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(file.string(), true);
    impl_->file = std::make_unique<spdlog::logger>("file", std::move(sink));
  } catch (const spdlog::spdlog_ex& exception) {
    return fail(ErrorCode::kIo, std::string("cannot write the log: ") + exception.what(),
                file.string());
  }
  impl_->file->set_pattern("%Y-%m-%d %H:%M:%S.%e %l: %v");
  impl_->file->set_level(spdlog::level::debug);
  impl_->file->flush_on(spdlog::level::info);
  return {};
}

void Console::close_file() {
  const std::lock_guard lock(impl_->mutex);
  impl_->file.reset();
}

void Console::progress(std::int64_t done, std::int64_t total, std::string_view what) {
  const auto now = SteadyClock::now();
  {
    const std::lock_guard lock(impl_->mutex);
    const bool is_new = impl_->last_what != what;
    const auto interval = impl_->terminal->is_terminal() ? SteadyClock::duration(kTerminalInterval)
                                                         : SteadyClock::duration(kLogInterval);
    if (!is_new && done != total && now - impl_->last_progress < interval) return;
    impl_->last_progress = now;
    impl_->last_what = what;
  }
  const std::string text = progress_text(done, total, what);
  if (impl_->terminal->is_terminal()) {
    impl_->terminal->show_line(text);
  } else {
    write(LogLevel::kInfo, text);
  }
}

void Console::end_progress() { impl_->terminal->erase_line(); }

}  // namespace sidestep
