#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/runtime/results_store.hpp>

namespace sidestep {

/// Reads single values of one item of a series; the first failure or missing value is kept.
class ItemReader {
 public:
  ItemReader(ResultsReader& reader, std::string series, std::int64_t item, std::string file)
      : reader_(reader), series_(std::move(series)), item_(item), file_(std::move(file)) {}

  double number(const std::string& key) {
    auto value = reader_.number(series_, item_, key);
    if (!value) return keep(std::move(value.error())), 0.0;
    if (!*value) return keep(missing(key)), 0.0;
    return **value;
  }
  int integer(const std::string& key) { return static_cast<int>(number(key)); }
  std::string text(const std::string& key) {
    auto value = reader_.text(series_, item_, key);
    if (!value) return keep(std::move(value.error())), "";
    if (!*value) return keep(missing(key)), "";
    return **value;
  }
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }

 private:
  [[nodiscard]] Error missing(const std::string& key) const {
    return Error{ErrorCode::kIo, "these are not the results of such an experiment", file_,
                 "there is no '" + key + "' of '" + series_ + "'", nullptr};
  }
  void keep(Error error) {
    if (!error_) error_ = std::move(error);
  }
  ResultsReader& reader_;
  std::string series_;
  std::int64_t item_;
  std::string file_;
  std::optional<Error> error_;
};

/// The columns of one series, all of one length, read in one pass.
class ColumnReader {
 public:
  ColumnReader(ResultsReader& reader, const std::string& series, const std::string& file) {
    auto done = reader.visit(series, [&](std::int64_t item, std::string_view key, double value) {
      if (items_.empty() || items_.back() != item) items_.push_back(item);
      auto at = columns_.find(key);
      if (at == columns_.end()) at = columns_.emplace(std::string(key), Column{}).first;
      at->second.push_back(value);
    });
    if (!done) error_ = std::move(done.error());
    for (auto& [key, column] : columns_) {
      if (column.size() == items_.size()) continue;
      error_ = Error{ErrorCode::kIo, "the rows of '" + series + "' are not complete", file,
                     "'" + key + "' is missing in some", nullptr};
      column.resize(items_.size(), 0.0);
    }
  }

  /// Ascending; one a row.
  [[nodiscard]] const std::vector<std::int64_t>& items() const { return items_; }
  /// Zeros where the series has no such column.
  std::vector<double> column(const std::string& key) {
    const auto at = columns_.find(key);
    return at != columns_.end() ? std::move(at->second) : Column(items_.size(), 0.0);
  }
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }

 private:
  using Column = std::vector<double>;
  std::map<std::string, Column, std::less<>> columns_;
  std::vector<std::int64_t> items_;
  std::optional<Error> error_;
};

}  // namespace sidestep
