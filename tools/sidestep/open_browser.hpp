#pragma once

#include <string>

#include <sidestep/core/log.hpp>

namespace sidestep {

/// Asks the desktop (xdg-open, without a shell) to show a page; tells `log` where it cannot be
/// asked. Does not wait.
void open_browser(const std::string& url, Log& log);

}  // namespace sidestep
