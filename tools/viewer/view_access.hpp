#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
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

/// Under which names a server is reached.
struct ViewAddress {
  std::string host;  ///< An IP address; "0.0.0.0" and "::" stand for all.
  unsigned short port = 0;
  std::optional<std::string> token;  ///< Without which nobody is shown anything.
  std::string machine;               ///< This machine's name.

  /// Of the page, token included.
  [[nodiscard]] std::string url() const;
};

/// What a request asks for, as far as it matters. Views into the request.
struct ViewRequest {
  std::string_view method;
  std::string_view target;  ///< Path and query, as sent.
  std::string_view host;    ///< Empty where there is none, or more than one.
  std::optional<std::string_view> origin;
  bool has_body = false;
  bool is_upgrade = false;  ///< To a WebSocket.
};

/// What it is answered.
struct ViewAnswer {
  int status = 200;                  ///< Of HTTP; 101 for the socket.
  const ViewAsset* asset = nullptr;  ///< With status 200.
  std::string_view why;              ///< With any other, for people.
};

/// Decides by itself alone, so that it can be tested by itself: the Host must be a name of this
/// server (against DNS rebinding), the socket's Origin its own page or none, the token right, the
/// path one of the assets'. [any]
[[nodiscard]] ViewAnswer answer(const ViewRequest& request, const ViewAddress& address,
                                const ViewAssets& assets);

/// Whether both are equal, in a time that tells only the lengths.
[[nodiscard]] bool equal_in_constant_time(std::string_view a, std::string_view b) noexcept;

/// 128 random bits of the system's, in hexadecimal. Fails with kInternal where it has none.
[[nodiscard]] Result<std::string> random_token();

}  // namespace sidestep
