#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include <sidestep/core/error.hpp>

namespace sidestep {

/// Text with what HTML would read as its own replaced.
[[nodiscard]] std::string escape_html(std::string_view text);
/// A whole page: title and body in the look of the reports, nothing fetched from anywhere.
[[nodiscard]] std::string html_page(std::string_view title, const std::string& body);
/// A picture file as the value of an img's src.
[[nodiscard]] Result<std::string> embedded_png(const std::filesystem::path& file);

}  // namespace sidestep
