#pragma once

#include <string>
#include <utility>

#include <sidestep/core/error.hpp>

namespace sidestep::ros1_executor {

inline constexpr const char* kWhere = "executor ros1";  ///< Of errors.

/// The robot is not told what it was to be told.
[[nodiscard]] inline tl::unexpected<Error> refuse(std::string why, std::string hint = {}) {
  return fail(ErrorCode::kInvalidArgument, std::move(why), kWhere, std::move(hint));
}

}  // namespace sidestep::ros1_executor
