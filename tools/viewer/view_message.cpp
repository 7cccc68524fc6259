#include "view_message.hpp"

#include <cmath>

#include <nlohmann/json.hpp>

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

std::optional<SliceRequest> read_slice(const Json& json) {
  if (!json.is_object() || json.size() != 2) return std::nullopt;
  const auto axis = json.find("axis");
  const auto position = json.find("position_m");
  if (axis == json.end() || !axis->is_string() || position == json.end() ||
      !position->is_number()) {
    return std::nullopt;
  }
  const std::string_view name = axis->get_ref<const std::string&>();
  const SliceRequest request{name == "x" ? 0 : name == "y" ? 1 : 2, position->get<double>()};
  const bool is_axis = name == "x" || name == "y" || name == "z";
  if (!is_axis || !std::isfinite(request.position_m)) return std::nullopt;
  return request;
}

}  // namespace

std::string_view to_string(ViewKind kind) noexcept {
  switch (kind) {
    case ViewKind::kWorld: return "world";
    case ViewKind::kMap: return "map";
    case ViewKind::kState: return "state";
    case ViewKind::kFrame: return "frame";
    case ViewKind::kPlan: return "plan";
    case ViewKind::kEvent: return "event";
    case ViewKind::kTiming: return "timing";
    case ViewKind::kSlice: return "slice";
    case ViewKind::kEnd: return "end";
    case ViewKind::kProfile: return "profile";
    case ViewKind::kReply: return "reply";
  }
  return "";
}

std::optional<PageMessage> read_page_message(std::string_view text) {
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object() || json.size() != 1) return std::nullopt;
  const auto slice = json.find("slice");
  if (slice == json.end()) return std::nullopt;
  if (slice->is_null()) return PageMessage{};
  const auto request = read_slice(*slice);
  if (!request) return std::nullopt;
  return PageMessage{request};
}

}  // namespace sidestep
