#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include <sidestep/core/error.hpp>

namespace sidestep {

/// A file of the page.
struct ViewAsset {
  std::string content_type;
  std::string bytes;
};

/// The files of the page, as they were at the start: nothing else is ever served. [any] once read.
class ViewAssets {
 public:
  static constexpr std::uintmax_t kMostBytes = std::uintmax_t{64} << 20;

  /// All regular files in the folder and below; links, and pages beside `page`, are left out. Fails
  /// with kNotFound where there is no such page, and with kIo where a file cannot be read or all
  /// are too large.
  [[nodiscard]] static Result<ViewAssets> read(const std::filesystem::path& folder,
                                               const std::string& page = "index.html");

  /// By the path of a URL, byte for byte: "/" is the page, "/viewer.js" a file beside it. Null
  /// where there is none.
  [[nodiscard]] const ViewAsset* find(std::string_view path) const;

 private:
  std::map<std::string, ViewAsset, std::less<>> assets_;
};

/// Where an installation or a build keeps the page: <prefix>/share/sidestep/viewer.
[[nodiscard]] std::filesystem::path view_assets_folder();

}  // namespace sidestep
