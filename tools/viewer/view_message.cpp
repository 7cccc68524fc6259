#include "view_message.hpp"

#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

std::optional<SliceRequest> read_slice(const Json& json) {
  if (!json.is_object()) return std::nullopt;
  const auto axis = json.find("axis");
  const auto position = json.find("position_m");
  if (axis == json.end() || !axis->is_string() || position == json.end() ||
      !position->is_number()) {
    return std::nullopt;
  }
  const std::string_view name = axis->get_ref<const std::string&>();
  SliceRequest request{name == "x" ? 0 : name == "y" ? 1 : 2, position->get<double>()};
  const bool is_axis = name == "x" || name == "y" || name == "z";
  if (!is_axis || !std::isfinite(request.position_m)) return std::nullopt;
  if (json.size() == 2) return request;
  const auto ahead = json.find("ahead_s");
  if (json.size() != 3 || ahead == json.end() || !ahead->is_number()) return std::nullopt;
  request.ahead_s = ahead->get<double>();
  if (!std::isfinite(*request.ahead_s)) return std::nullopt;
  return request;
}

}  // namespace

std::string_view to_string(ViewKind kind) noexcept {
  switch (kind) {
    case ViewKind::kWorld: return "world";
    case ViewKind::kMap: return "map";
    case ViewKind::kState: return "state";
    case ViewKind::kTracks: return "tracks";
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

ViewMessage make_message(ViewKind kind, Stamp time, Json header, const Payload& payload) {
  Json whole = {{"kind", to_string(kind)}, {"time_s", time.seconds()}};
  whole.update(std::move(header));
  const std::string text = whole.dump(-1, ' ', false, Json::error_handler_t::replace);
  const auto length = static_cast<std::uint32_t>(text.size());
  auto bytes = std::make_shared<std::string>();
  bytes->reserve(sizeof(length) + text.size() + 3 + payload.bytes().size());
  bytes->append(reinterpret_cast<const char*>(&length), sizeof(length));
  bytes->append(text);
  bytes->resize((bytes->size() + 3) / 4 * 4, '\0');
  bytes->append(payload.bytes());
  return {kind, time, std::move(bytes)};
}

Json point_json(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

Json pose_json(const Transform& pose) {
  const Eigen::Vector3d p = pose.translation();
  const Eigen::Quaterniond turn(pose.linear());
  return {p.x(), p.y(), p.z(), turn.x(), turn.y(), turn.z(), turn.w()};
}

}  // namespace sidestep
