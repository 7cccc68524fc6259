#pragma once

#include <functional>
#include <memory>
#include <optional>

#include <sidestep/core/error.hpp>

#include "view_message.hpp"

namespace sidestep {

/// The messages of a recorded run, from its beginning.
class Recording {
 public:
  virtual ~Recording() = default;
  /// The next message, with its time; nothing at the end. Fails with kIo.
  [[nodiscard]] virtual Result<std::optional<ViewMessage>> next() = 0;
};

/// Opens one for each page that connects.
using RecordingOpener = std::function<Result<std::unique_ptr<Recording>>()>;

}  // namespace sidestep
