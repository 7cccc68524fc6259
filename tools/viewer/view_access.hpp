#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "view_assets.hpp"

namespace sidestep {

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
