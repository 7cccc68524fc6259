#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

#include <sidestep/core/error.hpp>
#include <sidestep/core/log.hpp>

namespace sidestep {

/// What a run says while it goes on, on stderr and in a log file: messages, and progress as one
/// line that is updated on a terminal, as a line every few seconds elsewhere. [any]
class Console final : public Log {
 public:
  Console();
  ~Console() override;

  void write(LogLevel level, std::string_view message) override;

  /// From now on until close_file(), messages of every level are written to `file`, too; after
  /// what it holds where `append`.
  [[nodiscard]] Result<void> open_file(const std::filesystem::path& file, bool append = false);
  void close_file();

  /// `total` 0 where it is not known; where it is, the time left is told from the pace since it
  /// became so.
  void progress(std::int64_t done, std::int64_t total, std::string_view what);
  /// Removes the progress line, so that other output may follow.
  void end_progress();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sidestep
