#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
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
  std::string build_flags;    ///< Compiler, build type, flags, sanitizers.
  std::string cpu;            ///< Model and number of logical cores.
  int threads = 0;            ///< That the run was given.
  std::uint64_t seed = 0;
};

/// The provenance of this build on this machine; configuration, threads and seed are the
/// caller's to fill in. [any]
[[nodiscard]] RunProvenance current_provenance();

/// A matrix of numbers too many for single rows: an image, a slice through a field. Row by row.
struct StoredArray {
  int rows = 0;
  int columns = 0;
  std::vector<float> values;

  /// Appends a row of numbers, as many as the rows before have.
  template <class Row>
  void add_row(const Row& row) {
    values.insert(values.end(), std::begin(row), std::end(row));
    columns = static_cast<int>(std::size(row));
    ++rows;
  }
};

/// Every measurement of a run, in an SQLite file: one row a measurement, (series, item, key,
/// value), written in transactions so that an interrupted run keeps what it measured. An
/// existing file is replaced. [main]
///
/// Tables: provenance(key, value), measurements(series, item, key, value),
/// arrays(series, item, key, rows, columns, float32).
class ResultsStore {
 public:
  [[nodiscard]] static Result<std::unique_ptr<ResultsStore>> open(const std::filesystem::path& file,
                                                                  const RunProvenance& provenance);
  /// Opens the file of a run that ended early, to add to what it committed; its provenance stays.
  /// Fails with kNotFound where there is no file, kIo where it is not a results file.
  [[nodiscard]] static Result<std::unique_ptr<ResultsStore>> reopen(
      const std::filesystem::path& file);
  ~ResultsStore();
  ResultsStore(const ResultsStore&) = delete;
  ResultsStore& operator=(const ResultsStore&) = delete;

  /// E.g. add("frame", 17, "integrate_ms", 4.2). Infinities and NaN are stored as they are.
  [[nodiscard]] Result<void> add(std::string_view series, std::int64_t item, std::string_view key,
                                 double value);
  [[nodiscard]] Result<void> add(std::string_view series, std::int64_t item, std::string_view key,
                                 std::string_view text);
  /// Fails with kInvalidArgument where the values are not rows x columns.
  [[nodiscard]] Result<void> add(std::string_view series, std::int64_t item, std::string_view key,
                                 const StoredArray& array);
  /// Adds all that the results in another file hold but one series; their provenance stays there.
  /// What this holds already under the same name is replaced. Durable afterwards.
  [[nodiscard]] Result<void> absorb(const std::filesystem::path& file, std::string_view but_series);
  /// Makes what was added so far durable.
  [[nodiscard]] Result<void> commit();

 private:
  ResultsStore();
  [[nodiscard]] Result<void> prepare();
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Reads back what a ResultsStore wrote. [main]
class ResultsReader {
 public:
  /// Fails with kNotFound where there is no file, kIo where it is not a results file.
  [[nodiscard]] static Result<std::unique_ptr<ResultsReader>> open(
      const std::filesystem::path& file);
  ~ResultsReader();
  ResultsReader(const ResultsReader&) = delete;
  ResultsReader& operator=(const ResultsReader&) = delete;

  /// Every number of one key of a series, in the order of its items; empty if there is none.
  [[nodiscard]] Result<std::vector<double>> column(std::string_view series, std::string_view key);
  /// Hands over every number of a series, item by item, in one pass.
  using Visitor = std::function<void(std::int64_t item, std::string_view key, double value)>;
  [[nodiscard]] Result<void> visit(std::string_view series, const Visitor& visitor);
  /// One text; nothing if there is none.
  [[nodiscard]] Result<std::optional<std::string>> text(std::string_view series, std::int64_t item,
                                                        std::string_view key);
  /// One number; nothing if there is none.
  [[nodiscard]] Result<std::optional<double>> number(std::string_view series, std::int64_t item,
                                                     std::string_view key);
  /// The items of a series that hold an array under `key`, ascending.
  [[nodiscard]] Result<std::vector<std::int64_t>> array_items(std::string_view series,
                                                              std::string_view key);
  [[nodiscard]] Result<std::optional<StoredArray>> array(std::string_view series, std::int64_t item,
                                                         std::string_view key);

 private:
  ResultsReader();
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sidestep
