#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/experiments/experiments.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/session.hpp>

#include "console.hpp"

namespace sidestep {

/// How the command ends (docs/reference/command.md).
enum class ExitCode {
  kSuccess = 0,
  kTaskFailed = 1,
  kConfiguration = 2,
  kPlugin = 3,
  kFault = 4,
};
/// Of an error at run time.
[[nodiscard]] ExitCode exit_code(const Error& error) noexcept;
/// Of the mistakes in a configuration; not empty.
[[nodiscard]] ExitCode exit_code(const std::vector<Error>& errors) noexcept;
[[nodiscard]] ExitCode worse(ExitCode a, ExitCode b) noexcept;

/// Prints errors on stderr, one a line.
void print_errors(const std::vector<Error>& errors);

/// A configuration file as a user names it: a file, or a name in the installation's folder of
/// configurations, with or without .yaml.
[[nodiscard]] Result<std::filesystem::path> find_configuration(const std::string& name);

/// A configuration that was read and checked.
struct CheckedConfiguration {
  Configuration configuration;
  RunSettings settings;
  std::unique_ptr<Session> session;  ///< Null where the file could not be read.
  std::vector<Error> errors;
};
[[nodiscard]] CheckedConfiguration load_configuration(const std::string& name,
                                                      const std::vector<std::string>& overrides,
                                                      Log& log);

}  // namespace sidestep
