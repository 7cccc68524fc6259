#include "histories.hpp"

#include <cmath>
#include <numbers>

namespace sidestep::ros_messages {
namespace {

std::string seconds_text(Stamp stamp) {
  std::string digits = std::to_string(stamp.ns % 1'000'000'000);
  digits.insert(0, 9 - std::min<std::size_t>(9, digits.size()), '0');
  return std::to_string(stamp.ns / 1'000'000'000) + "." + digits.substr(0, 6) + " s";
}

std::string in_quotes(std::string_view name) { return "'" + std::string(name) + "'"; }

/// The frame that holds two samples at once, if they agree.
template <class Bracket>
bool same_parent(const Bracket& bracket) {
  return bracket.before->value.parent == bracket.after->value.parent;
}

const char* reason(LookupFault fault) {
  switch (fault) {
    case LookupFault::kTooEarly: return "joint states begin later than the wanted time";
    case LookupFault::kTooLate: return "joint states end earlier than the wanted time";
    case LookupFault::kGap: return "joint states have a gap longer than the longest allowed";
    default: return "joint states do not tell";
  }
}

}  // namespace

Transform RigidPose::transform() const {
  Transform transform = Transform::Identity();
  transform.linear() = rotation.toRotationMatrix();
  transform.translation() = translation_m;
  return transform;
}

std::optional<RigidPose> rigid_pose(const Eigen::Vector3d& translation_m,
                                    const Eigen::Quaterniond& rotation) {
  constexpr double kLengthTolerance = 1e-2;
  const bool is_rotation = std::abs(rotation.norm() - 1.0) <= kLengthTolerance;
  if (!translation_m.allFinite() || !is_rotation) return std::nullopt;
  // What has length 1 up to rounding stays as it was written.
  const bool is_unit = std::abs(rotation.squaredNorm() - 1.0) <= 1e-14;
  return RigidPose{translation_m, is_unit ? rotation : rotation.normalized()};
}

RigidPose rigid_pose(const Transform& transform) {
  return {transform.translation(), Eigen::Quaterniond(transform.linear()).normalized()};
}

RigidPose interpolate(const RigidPose& before, const RigidPose& after, double share) {
  if (share <= 0.0) return before;
  if (share >= 1.0) return after;
  return {(1.0 - share) * before.translation_m + share * after.translation_m,
          before.rotation.slerp(share, after.rotation).normalized()};
}

std::string frame_name(std::string_view name) {
  return std::string(name.starts_with('/') ? name.substr(1) : name);
}

struct TfTree::Chain {
  struct Link {
    std::string frame;
    Transform T_frame_first;
  };
  std::vector<Link> links;
  std::optional<LookupFailure> broken;  ///< Why it ends; nothing at a root or at `until`.

  [[nodiscard]] const Link* find(std::string_view frame) const {
    const auto link = std::ranges::find(links, frame, &Link::frame);
    return link == links.end() ? nullptr : &*link;
  }
};

TfTree::FrameHistory* TfTree::history(std::string_view parent, std::string_view child) {
  if (parent.empty() || child.empty() || parent == child) return nullptr;
  frames_.try_emplace(std::string(parent));
  return &frames_.try_emplace(std::string(child)).first->second;
}

bool TfTree::add(std::string_view parent, std::string_view child, Stamp stamp,
                 const RigidPose& pose) {
  const std::string above = frame_name(parent);
  FrameHistory* const frame = history(above, frame_name(child));
  return frame != nullptr && frame->moving.add(stamp, {above, pose});
}

bool TfTree::add_static(std::string_view parent, std::string_view child, const RigidPose& pose) {
  const std::string above = frame_name(parent);
  FrameHistory* const frame = history(above, frame_name(child));
  if (frame == nullptr) return false;
  frame->fixed = Placement{above, pose};
  return true;
}

TfTree::Step TfTree::placement(const std::string& frame, const FrameHistory& history, Stamp stamp,
                               double max_gap_s) const {
  if (history.fixed) return *history.fixed;
  const auto failure = [&](LookupFault fault, const std::string& message) {
    return tl::make_unexpected(LookupFailure{
        fault, message + " of frame " + in_quotes(frame) + " at " + seconds_text(stamp)});
  };
  const auto bracket = history.moving.around(stamp, max_gap_s);
  if (!bracket) {
    switch (bracket.error()) {
      case LookupFault::kTooEarly:
        return failure(bracket.error(), "tf begins later, at " +
                                            seconds_text(history.moving.samples().front().stamp) +
                                            ", than the pose");
      case LookupFault::kTooLate:
        return failure(bracket.error(), "tf ends earlier, at " +
                                            seconds_text(history.moving.samples().back().stamp) +
                                            ", than the pose");
      case LookupFault::kGap:
        return failure(bracket.error(), "tf has a gap longer than the longest allowed in the pose");
      default: return failure(bracket.error(), "tf does not hold the pose");
    }
  }
  if (!same_parent(*bracket)) {
    return failure(LookupFault::kReparented,
                   "tf gives another parent, " + in_quotes(bracket->before->value.parent) + " or " +
                       in_quotes(bracket->after->value.parent) + ", around the pose");
  }
  return Placement{
      bracket->before->value.parent,
      interpolate(bracket->before->value.pose, bracket->after->value.pose, bracket->share)};
}

template <class StepOf>
TfTree::Chain TfTree::climb(const std::string& frame, const Chain* until, StepOf&& step) const {
  Chain chain;
  chain.links.push_back({frame, Transform::Identity()});
  while (until == nullptr || until->find(chain.links.back().frame) == nullptr) {
    const auto entry = frames_.find(chain.links.back().frame);
    const FrameHistory& history = entry->second;
    if (!history.fixed && history.moving.samples().empty()) return chain;
    Step placed = step(entry->first, history);
    if (!placed) {
      chain.broken = std::move(placed.error());
      return chain;
    }
    if (chain.find(placed->parent) != nullptr) {
      chain.broken = LookupFailure{LookupFault::kNotConnected,
                                   "tf goes in a circle through " + in_quotes(placed->parent)};
      return chain;
    }
    const Transform T_parent_first = placed->pose.transform() * chain.links.back().T_frame_first;
    chain.links.push_back({std::move(placed->parent), T_parent_first});
  }
  return chain;
}

template <class StepOf>
tl::expected<Transform, LookupFailure> TfTree::path(std::string_view target,
                                                    std::string_view source, StepOf&& step) const {
  const std::string to = frame_name(target);
  const std::string from = frame_name(source);
  for (const std::string& name : {to, from}) {
    if (frames_.contains(name)) continue;
    return tl::make_unexpected(
        LookupFailure{LookupFault::kUnknown, "tf knows no frame " + in_quotes(name)});
  }
  const Chain upward = climb(from, nullptr, step);
  const Chain downward = climb(to, &upward, step);
  if (const auto* meeting = upward.find(downward.links.back().frame)) {
    if (downward.links.size() == 1) return meeting->T_frame_first;
    return downward.links.back().T_frame_first.inverse() * meeting->T_frame_first;
  }
  if (upward.broken) return tl::make_unexpected(*upward.broken);
  if (downward.broken) return tl::make_unexpected(*downward.broken);
  return tl::make_unexpected(LookupFailure{
      LookupFault::kNotConnected,
      "tf has no path from " + in_quotes(from) + ", below " + in_quotes(upward.links.back().frame) +
          ", to " + in_quotes(to) + ", below " + in_quotes(downward.links.back().frame)});
}

tl::expected<Transform, LookupFailure> TfTree::lookup(std::string_view target,
                                                      std::string_view source, Stamp stamp,
                                                      double max_gap_s) const {
  return path(target, source, [&](const std::string& frame, const FrameHistory& history) {
    return placement(frame, history, stamp, max_gap_s);
  });
}

std::optional<LookupFailure> TfTree::missing_path(std::string_view target,
                                                  std::string_view source) const {
  const auto found = path(target, source, [](const std::string&, const FrameHistory& history) {
    return Step(history.fixed ? *history.fixed : history.moving.samples().front().value);
  });
  if (found) return std::nullopt;
  return found.error();
}

std::vector<std::string> TfTree::roots() const {
  std::vector<std::string> names;
  for (const auto& [name, history] : frames_) {
    if (!history.fixed && history.moving.samples().empty()) names.push_back(name);
  }
  return names;
}

void TfTree::forget_before(Stamp stamp) {
  for (auto& [name, history] : frames_) history.moving.forget_before(stamp);
}

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
