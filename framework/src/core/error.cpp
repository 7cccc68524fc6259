#include <sidestep/core/error.hpp>

namespace sidestep {

std::string_view to_string(ErrorCode code) noexcept {
  switch (code) {
    case ErrorCode::kInvalidArgument: return "invalid_argument";
    case ErrorCode::kConfig: return "config";
    case ErrorCode::kPlugin: return "plugin";
    case ErrorCode::kNotFound: return "not_found";
    case ErrorCode::kIo: return "io";
    case ErrorCode::kBadFrame: return "bad_frame";
    case ErrorCode::kUnsupported: return "unsupported";
    case ErrorCode::kDeadlineExceeded: return "deadline_exceeded";
    case ErrorCode::kCancelled: return "cancelled";
    case ErrorCode::kInternal: return "internal";
  }
  return "internal";
}

std::string Error::describe() const {
  std::string text;
  for (const Error* error = this; error != nullptr; error = error->cause.get()) {
    if (error != this) text += "\n  because ";
    if (!error->where.empty()) text += error->where + ": ";
    text += error->message;
    if (!error->hint.empty()) text += " (" + error->hint + ")";
  }
  return text;
}

Error Error::wrapped(ErrorCode new_code, std::string new_message, std::string new_where) const {
  return Error{new_code,
               std::move(new_message),
               std::move(new_where),
               {},
               std::make_shared<const Error>(*this)};
}

}  // namespace sidestep
