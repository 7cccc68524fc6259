#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include <tl/expected.hpp>

namespace sidestep {

/// What kind of thing went wrong. Decides the exit code of the `sidestep` command and
/// whether a caller may go on; the words for people are in Error::message.
enum class ErrorCode {
  kInvalidArgument,   ///< A caller's argument breaks the documented contract.
  kConfig,            ///< A configuration, profile or scene file is wrong (exit code 2).
  kPlugin,            ///< A plugin could not be loaded, created, or threw (exit code 3).
  kNotFound,          ///< A file or a name does not exist.
  kIo,                ///< Reading or writing failed.
  kBadFrame,          ///< One frame is unusable; the next one may be fine.
  kUnsupported,       ///< Two parts do not fit together (e.g. a field needs another mapper).
  kDeadlineExceeded,  ///< The deadline passed before there was any result.
  kCancelled,         ///< The user or the host asked to stop.
  kInternal,          ///< A fault of Sidestep's own.
};

/// The stable lower-case name of a code, e.g. "bad_frame".
[[nodiscard]] std::string_view to_string(ErrorCode code) noexcept;

/// A failure, in words that a user can act on.
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;                 ///< What is wrong, one sentence, no full stop.
  std::string where;                   ///< `file:line:col`, frame, link or plugin; may be empty.
  std::string hint;                    ///< What to do about it; may be empty.
  std::shared_ptr<const Error> cause;  ///< What led to it; may be null.

  /// `where: message (hint)`, then each cause on a line of its own.
  [[nodiscard]] std::string describe() const;

  /// This error as the cause of a new one.
  [[nodiscard]] Error wrapped(ErrorCode new_code, std::string new_message,
                              std::string new_where = {}) const;
};

template <class T>
using Result = tl::expected<T, Error>;

/// Shorthand for returning a failure from a function that returns Result<T>.
[[nodiscard]] inline tl::unexpected<Error> fail(ErrorCode code, std::string message,
                                                std::string where = {}, std::string hint = {}) {
  return tl::make_unexpected(
      Error{code, std::move(message), std::move(where), std::move(hint), nullptr});
}

/// The same for arguments that are wrong.
[[nodiscard]] inline tl::unexpected<Error> invalid(std::string message, std::string hint = {}) {
  return fail(ErrorCode::kInvalidArgument, std::move(message), {}, std::move(hint));
}

/// Passes a failure on to the caller.
template <class T, class E>
[[nodiscard]] tl::unexpected<E> error_of(const tl::expected<T, E>& failed) {
  return tl::make_unexpected(failed.error());
}

namespace detail {
template <class T, class E>
[[nodiscard]] T value_of(tl::expected<T, E>&& result) {
  if constexpr (!std::is_void_v<T>) return *std::move(result);
}
}  // namespace detail

}  // namespace sidestep

/// The value of a Result; returns its error from the enclosing function where there is none:
/// `const auto field = SIDESTEP_TRY(builder.update(map));`. A statement expression of g++ and
/// clang.
#define SIDESTEP_TRY(...) SIDESTEP_TRY_AS(__COUNTER__, __VA_ARGS__)
#define SIDESTEP_TRY_AS(counter, ...) SIDESTEP_TRY_NAMED(counter, __VA_ARGS__)
#define SIDESTEP_TRY_NAMED(counter, ...)                                              \
  __extension__({                                                                     \
    auto sidestep_try_##counter = (__VA_ARGS__);                                      \
    if (!sidestep_try_##counter) return ::sidestep::error_of(sidestep_try_##counter); \
    ::sidestep::detail::value_of(std::move(sidestep_try_##counter));                  \
  })
