#include <sidestep/report/text_table.hpp>

#include <algorithm>

namespace sidestep {
namespace {

/// Characters, not bytes, of UTF-8 text.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0u) != 0x80u; }));
}

}  // namespace

std::string TextTable::text() const {
  std::vector<std::size_t> widths(rows_.front().size(), 0);
  for (const auto& row : rows_) {
    for (std::size_t c = 0; c < widths.size() && c < row.size(); ++c) {
      widths[c] = std::max(widths[c], width_of(row[c]));
    }
  }
  std::string text;
  const auto add_row = [&](const std::vector<std::string>& row) {
    for (std::size_t c = 0; c < widths.size(); ++c) {
      const std::string cell = c < row.size() ? row[c] : "";
      const std::string space(widths[c] - width_of(cell), ' ');
      text += (c == 0 ? cell + space : "  " + space + cell);
    }
    text.erase(text.find_last_not_of(' ') + 1);
    text += '\n';
  };
  add_row(rows_.front());
  std::size_t total = 2 * (widths.size() - 1);
  for (const std::size_t width : widths) total += width;
  text += std::string(total, '-') + "\n";
  for (std::size_t r = 1; r < rows_.size(); ++r) add_row(rows_[r]);
  return text;
}

}  // namespace sidestep
