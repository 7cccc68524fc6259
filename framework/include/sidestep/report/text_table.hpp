#pragma once

#include <string>
#include <vector>

#include <sidestep/core/format.hpp>

namespace sidestep {

/// A table in columns of equal width for a terminal; the first column is flush left, the
/// others flush right.
class TextTable {
 public:
  explicit TextTable(std::vector<std::string> header) : rows_{std::move(header)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  [[nodiscard]] std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace sidestep
