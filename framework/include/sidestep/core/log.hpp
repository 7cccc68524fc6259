#pragma once

#include <string_view>

#include <sidestep/core/export.hpp>

namespace sidestep {

enum class LogLevel { kDebug, kInfo, kWarning, kError };

/// Where messages go; the host decides what is shown and stored. [any] thread.
class SIDESTEP_EXPORT Log {
 public:
  virtual ~Log() = default;
  virtual void write(LogLevel level, std::string_view message) = 0;

  void debug(std::string_view message) { write(LogLevel::kDebug, message); }
  void info(std::string_view message) { write(LogLevel::kInfo, message); }
  void warn(std::string_view message) { write(LogLevel::kWarning, message); }
  void error(std::string_view message) { write(LogLevel::kError, message); }
};

}  // namespace sidestep
