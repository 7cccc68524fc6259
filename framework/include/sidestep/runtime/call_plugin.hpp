#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include <sidestep/core/error.hpp>
#include <sidestep/core/plugin_calls.hpp>

namespace sidestep {

/// An exception of a plugin on its way through code that cannot know whose object it called: a
/// robot is called from deep within costs and checks, some of them of other plugins.
class PluginThrew final : public std::runtime_error {
 public:
  /// `plugin`: kind and name, e.g. "robot urdf". `what`: of the exception.
  PluginThrew(std::string plugin, const std::string& what)
      : std::runtime_error(what), plugin_(std::move(plugin)) {}

  [[nodiscard]] const std::string& plugin() const noexcept { return plugin_; }

 private:
  std::string plugin_;
};

/// The exception that is being handled as an error: kPlugin naming the plugin for PluginThrew, else
/// `code` and `where`. To be called in a handler.
[[nodiscard]] Error error_in_flight(ErrorCode code, std::string where);

/// What the exception that is being handled says. To be called in a handler.
[[nodiscard]] std::string text_in_flight();

/// `error` with the plugin named in `where`, unless it is there already.
[[nodiscard]] Error named_after(Error error, std::string_view plugin);

/// Calls into a plugin; an exception that escapes becomes a kPlugin error naming the plugin.
/// `call` returns a Result.
template <class Call>
[[nodiscard]] auto call_plugin(std::string_view plugin, Call&& call) -> std::invoke_result_t<Call> {
  const PluginCall noted(plugin);
  try {
    return call();
  } catch (...) {
    return tl::make_unexpected(
        error_in_flight(ErrorCode::kPlugin, "plugin " + std::string(plugin)));
  }
}

/// As call_plugin(), and errors that the call returns name the plugin, too: a stage of a run.
template <class Call>
[[nodiscard]] auto call_stage(std::string_view plugin, Call&& call) -> std::invoke_result_t<Call> {
  auto result = call_plugin(plugin, std::forward<Call>(call));
  if (result) return result;
  return tl::make_unexpected(named_after(std::move(result.error()), plugin));
}

/// Runs `what`, in which plugins are called here and there: an exception that escapes becomes an
/// error that names the plugin it came from, or else a kInternal one that names `what`.
template <class Call>
[[nodiscard]] auto catch_all(std::string_view what, Call&& call) -> std::invoke_result_t<Call> {
  try {
    return call();
  } catch (...) {
    return tl::make_unexpected(error_in_flight(ErrorCode::kInternal, std::string(what)));
  }
}

}  // namespace sidestep
