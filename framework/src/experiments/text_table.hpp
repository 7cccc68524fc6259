#pragma once

#include <string>
#include <vector>

namespace sidestep {

/// One number in words, as printf does it: format("%.2f s", 1.5).
[[nodiscard]] std::string format(const char* pattern, double value);

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
