#include "view_assets.hpp"

#include <array>
#include <fstream>
#include <iterator>
#include <utility>

#include <sidestep/runtime/install_layout.hpp>

namespace sidestep {
namespace {

namespace fs = std::filesystem;

std::string content_type(const fs::path& file) {
  static constexpr std::array<std::pair<std::string_view, const char*>, 13> kTypes{{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".map", "application/json"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".ico", "image/x-icon"},
      {".wasm", "application/wasm"},
      {".woff2", "font/woff2"},
      {".txt", "text/plain; charset=utf-8"},
      {".webmanifest", "application/manifest+json"},
  }};
  const std::string extension = file.extension().string();
  for (const auto& [name, type] : kTypes) {
    if (name == extension) return type;
  }
  return "application/octet-stream";
}

tl::unexpected<Error> not_readable(const fs::path& file, const std::string& why) {
  return fail(ErrorCode::kIo, "cannot read the viewer's page: " + why, file.string());
}

}  // namespace

Result<ViewAssets> ViewAssets::read(const fs::path& folder, const std::string& page) {
  ViewAssets assets;
  std::error_code error;
  if (!fs::is_regular_file(folder / page, error)) {
    return fail(
        ErrorCode::kNotFound, "this build of Sidestep has no viewer's page", folder.string(),
        "install nodejs and npm (tools/install_deps.sh does), then configure and build again");
  }
  std::uintmax_t total = 0;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (!fs::is_regular_file(entry->symlink_status())) continue;
    const bool is_page = entry->path().extension() == ".html";
    if (is_page && entry->path() != folder / page) continue;
    total += entry->file_size();
    if (total > kMostBytes) return not_readable(folder, "the folder holds more than 64 MiB");
    std::ifstream in(entry->path(), std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(in), {}};
    if (in.bad() || !in.is_open())
      return not_readable(entry->path(), "no such file, or no permission");
    const std::string path = "/" + entry->path().lexically_relative(folder).generic_string();
    assets.assets_[path] = {content_type(entry->path()), std::move(bytes)};
  }
  if (error) return not_readable(folder, error.message());
  assets.assets_["/"] = assets.assets_["/" + page];
  return assets;
}

const ViewAsset* ViewAssets::find(std::string_view path) const {
  const auto found = assets_.find(path);
  return found == assets_.end() ? nullptr : &found->second;
}

fs::path view_assets_folder() { return install_layout().configs.parent_path() / "viewer"; }

}  // namespace sidestep
