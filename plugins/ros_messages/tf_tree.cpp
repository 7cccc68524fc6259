#include "tf_tree.hpp"

#include <algorithm>
#include <utility>

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

}  // namespace

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

}  // namespace sidestep::ros_messages
