#pragma once

#include <optional>
#include <stop_token>
#include <string_view>
#include <vector>

#include "view_message.hpp"

namespace sidestep {

/// Answers what a page asks, where it may ask for more than slices. Called by one thread of the
/// server's, one request after the other; a page's next request is not read before it has been
/// answered.
class PageDesk {
 public:
  virtual ~PageDesk() = default;

  /// What a page is told first.
  [[nodiscard]] virtual std::vector<ViewMessage> greeting() = 0;
  /// Nothing for what is no request: whoever has sent it is dropped. Soon after a stop is
  /// requested the answer is no matter any more.
  [[nodiscard]] virtual std::optional<ViewMessage> answer(std::string_view request,
                                                          const std::stop_token& stop) = 0;
};

}  // namespace sidestep
