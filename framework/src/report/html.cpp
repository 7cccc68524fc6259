#include <sidestep/report/html.hpp>

#include <sidestep/results/text_file.hpp>

namespace sidestep {
namespace {

constexpr std::string_view kStyle = R"(
  body { font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; color: #222; background: #fff;
         max-width: 960px; margin: 2em auto; padding: 0 1em; }
  h1 { font-size: 1.5em; } h2 { font-size: 1.2em; margin-top: 2em; border-bottom: 1px solid #ddd; }
  .verdict { padding: .8em 1em; border-left: 6px solid; font-size: 1.1em; }
  .success { border-color: #0072B2; background: #eaf4fa; }
  .failure { border-color: #D55E00; background: #fdf0e6; }
  table { border-collapse: collapse; margin: 1em 0; }
  .wide { overflow-x: auto; width: min-content; min-width: 100%; max-width: calc(100vw - 3em);
          position: relative; left: 50%; transform: translateX(-50%); }
  .wide td { white-space: nowrap; } .wide td.long { white-space: normal; }
  th, td { padding: .3em .8em; text-align: right; border-bottom: 1px solid #ddd;
           vertical-align: top; }
  th:first-child, td:first-child, td.text { text-align: left; }
  th { background: #f5f5f5; }
  figure { margin: 1.5em 0; } figure img { width: 100%; max-width: 900px; }
  figcaption { color: #555; }
  pre { background: #f7f7f7; padding: 1em; overflow-x: auto; font-size: 13px; }
)";

std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      word <<= 8;
      if (i + k < bytes.size()) word |= static_cast<unsigned char>(bytes[i + k]);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text += i + k <= bytes.size() ? kDigits[word >> (18 - 6 * k) & 63u] : '=';
    }
  }
  return text;
}

}  // namespace

std::string escape_html(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '&': safe += "&amp;"; break;
      case '<': safe += "&lt;"; break;
      case '>': safe += "&gt;"; break;
      case '"': safe += "&quot;"; break;
      default: safe += c;
    }
  }
  return safe;
}

std::string html_page(std::string_view title, const std::string& body) {
  std::string page = "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n";
  page += "<meta name=\"viewport\" content=\"width=device-width\">\n<title>";
  page += escape_html(title);
  page += "</title>\n<style>";
  page += kStyle;
  page += "</style>\n</head>\n<body>\n";
  page += body;
  page += "</body>\n</html>\n";
  return page;
}

Result<std::string> embedded_png(const std::filesystem::path& file) {
  auto bytes = SIDESTEP_TRY(read_file(file));
  return "data:image/png;base64," + base64(bytes);
}

}  // namespace sidestep
