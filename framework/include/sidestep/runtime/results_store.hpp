#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>

namespace sidestep {

/// What a run was made with; stored with every result.
struct RunProvenance {
  std::string configuration;  ///< Name of the configuration.
  std::string version;        ///< Of Sidestep.
  std::string git_hash;       ///< Of the sources, "+" appended if they were changed.
  std::string build_flags;
  std::string cpu;
  int threads = 0;
  std::uint64_t seed = 0;
};

/// The provenance of this build on this machine.
[[nodiscard]] RunProvenance current_provenance();

/// Every measurement of a run, in an SQLite file: one row a measurement, (series, item, key,
/// value), written in transactions so that an interrupted run keeps what it measured. [main]
class ResultsStore {
 public:
  [[nodiscard]] static Result<std::unique_ptr<ResultsStore>> open(const std::filesystem::path& file,
                                                                  const RunProvenance& provenance);
  ~ResultsStore();

  /// E.g. add("frame", 17, "integrate_ms", 4.2).
  [[nodiscard]] Result<void> add(std::string_view series, std::int64_t item, std::string_view key,
                                 double value);
  [[nodiscard]] Result<void> add(std::string_view series, std::int64_t item, std::string_view key,
                                 std::string_view text);
  /// Makes what was added so far durable.
  [[nodiscard]] Result<void> commit();

 private:
  ResultsStore();
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sidestep
