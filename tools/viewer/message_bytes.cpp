#include "message_bytes.hpp"

#include <utility>

namespace sidestep {

using Json = nlohmann::ordered_json;

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
