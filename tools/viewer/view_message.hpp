#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include <sidestep/core/time.hpp>

namespace sidestep {

/// What a message to the page is about (docs/reference/viewer.md).
enum class ViewKind : std::uint8_t {
  kWorld,
  kMap,
  kState,
  kFrame,
  kPlan,
  kEvent,
  kTiming,
  kSlice,
  kEnd,
  kProfile,  ///< Of the sphere editor (docs/reference/sphere_editor.md), as the next one.
  kReply,
};
/// As the header's `kind` says it.
[[nodiscard]] std::string_view to_string(ViewKind kind) noexcept;

/// A message to the page, as it travels: header, padding, payload. Shared by all that it goes to.
struct ViewMessage {
  ViewKind kind = ViewKind::kWorld;
  Stamp stamp;  ///< The header's `time_s`.
  std::shared_ptr<const std::string> bytes;
};

/// A slice through the field that a page asks for.
struct SliceRequest {
  int axis = 2;             ///< 0: x, 1: y, 2: z.
  double position_m = 0.0;  ///< Along the axis, world frame.

  friend bool operator==(const SliceRequest&, const SliceRequest&) = default;
};

/// All that a page may send.
struct PageMessage {
  std::optional<SliceRequest> slice;  ///< Nothing: no slice any more.
};
/// Nothing where the text is anything else.
[[nodiscard]] std::optional<PageMessage> read_page_message(std::string_view text);

}  // namespace sidestep
