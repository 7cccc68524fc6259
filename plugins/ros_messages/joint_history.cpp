#include "joint_history.hpp"

#include <cmath>
#include <numbers>

namespace sidestep::ros_messages {
namespace {

const char* reason(LookupFault fault) {
  switch (fault) {
    case LookupFault::kTooEarly: return "joint states begin later than the wanted time";
    case LookupFault::kTooLate: return "joint states end earlier than the wanted time";
    case LookupFault::kGap: return "joint states have a gap longer than the longest allowed";
    default: return "joint states do not tell";
  }
}

}  // namespace

bool JointHistory::add(std::string_view joint, Stamp stamp, double position) {
  if (!std::isfinite(position)) return false;
  auto at = joints_.find(joint);
  if (at == joints_.end()) at = joints_.try_emplace(std::string(joint)).first;
  return at->second.add(stamp, position);
}

std::vector<std::string> JointHistory::missing(std::span<const Joint> joints) const {
  std::vector<std::string> names;
  for (const Joint& joint : joints) {
    if (!joints_.contains(joint.name)) names.push_back(joint.name);
  }
  return names;
}

std::vector<std::string> JointHistory::names() const {
  std::vector<std::string> names;
  for (const auto& [name, series] : joints_) names.push_back(name);
  return names;
}

tl::expected<double, LookupFailure> JointHistory::position(const Joint& joint, Stamp stamp,
                                                           double max_gap_s) const {
  const auto failure = [&](LookupFault fault) {
    return tl::make_unexpected(
        LookupFailure{fault, std::string(reason(fault)) + ", of joint '" + joint.name + "'"});
  };
  const auto series = joints_.find(joint.name);
  if (series == joints_.end()) return failure(LookupFault::kUnknown);
  const auto bracket = series->second.around(stamp, max_gap_s);
  if (!bracket) return failure(bracket.error());
  const double from = bracket->before->value;
  double way = bracket->after->value - from;
  if (joint.type == Joint::Type::kContinuous) {
    way = std::remainder(way, 2.0 * std::numbers::pi);
  }
  return from + bracket->share * way;
}

void JointHistory::forget_before(Stamp stamp) {
  for (auto& [name, series] : joints_) series.forget_before(stamp);
}

}  // namespace sidestep::ros_messages
