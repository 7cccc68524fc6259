#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <tl/expected.hpp>

#include <sidestep/core/time.hpp>
#include <sidestep/geometry/transform.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep::ros_messages {

/// A rigid transform as messages carry it, and as it is interpolated. The rotation has length 1.
struct RigidPose {
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();

  [[nodiscard]] Transform transform() const;
};

/// A message's figures as a pose; nothing where one is not finite, or the quaternion's length is
/// off 1 by more than 0.01. [any]
[[nodiscard]] std::optional<RigidPose> rigid_pose(const Eigen::Vector3d& translation_m,
                                                  const Eigen::Quaterniond& rotation);

/// The pose of a transform.
[[nodiscard]] RigidPose rigid_pose(const Transform& transform);

/// Between `before` (share 0) and `after` (share 1): linear in position, slerp in orientation; at
/// either end that pose itself, bit for bit. [any]
[[nodiscard]] RigidPose interpolate(const RigidPose& before, const RigidPose& after, double share);

/// Why there is no value at a time.
enum class LookupFault : std::uint8_t {
  kUnknown,       ///< There is nothing of that name at all.
  kNotConnected,  ///< Both frames are there, without a path between them.
  kTooEarly,      ///< What is known begins later.
  kTooLate,       ///< What is known ends earlier; for a live stream, it may still come.
  kGap,           ///< The values around that time are too far apart to go between.
  kReparented,    ///< A frame changed its parent around that time.
};

/// Values at times, in whatever order they come. One thread at a time.
template <class Value>
class TimeSeries {
 public:
  struct Sample {
    Stamp stamp;
    Value value;
  };
  /// The samples at or around a time; both are the same one where it has that very stamp.
  struct Bracket {
    const Sample* before;
    const Sample* after;
    double share;  ///< How far the time is on the way from `before` to `after`, in [0, 1).
  };

  /// False, and nothing is changed, where there is a value of that stamp.
  bool add(Stamp stamp, Value value) {
    auto at = samples_.end();  // Most come in order.
    if (!samples_.empty() && samples_.back().stamp >= stamp) {
      at = std::ranges::lower_bound(samples_, stamp, {}, &Sample::stamp);
      if (at->stamp == stamp) return false;
    }
    samples_.insert(at, Sample{stamp, std::move(value)});
    return true;
  }

  /// Fails with kUnknown, kTooEarly, kTooLate, or with kGap where the two samples around `stamp`
  /// are more than `max_gap_s` apart.
  [[nodiscard]] tl::expected<Bracket, LookupFault> around(Stamp stamp, double max_gap_s) const {
    if (samples_.empty()) return tl::make_unexpected(LookupFault::kUnknown);
    const auto after = std::ranges::lower_bound(samples_, stamp, {}, &Sample::stamp);
    if (after == samples_.end()) return tl::make_unexpected(LookupFault::kTooLate);
    if (after->stamp == stamp) return Bracket{&*after, &*after, 0.0};
    if (after == samples_.begin()) return tl::make_unexpected(LookupFault::kTooEarly);
    const auto before = std::prev(after);
    const double gap_s = static_cast<double>(after->stamp.ns - before->stamp.ns) * 1e-9;
    if (gap_s > max_gap_s) return tl::make_unexpected(LookupFault::kGap);
    const double share = static_cast<double>(stamp.ns - before->stamp.ns) * 1e-9 / gap_s;
    return Bracket{&*before, &*after, share};
  }

  /// Forgets what no lookup at `stamp` or later needs.
  void forget_before(Stamp stamp) {
    while (samples_.size() > 1 && samples_[1].stamp <= stamp) samples_.pop_front();
  }

  [[nodiscard]] const std::deque<Sample>& samples() const noexcept { return samples_; }

 private:
  std::deque<Sample> samples_;
};

/// Why a transform is not known, in a word for programs and a sentence for people.
struct LookupFailure {
  LookupFault fault = LookupFault::kUnknown;
  std::string message;  ///< No full stop; names the frames.
};

/// A frame's name without the slash that tf of old put before it.
[[nodiscard]] std::string frame_name(std::string_view name);

/// The tree of frames that tf messages tell of, over time. Transforms come in any order. A frame
/// that is static keeps its last transform for all times, whatever else is said of it. Unlike tf2's
/// buffer it never extrapolates, and never goes between two transforms that are too far apart. One
/// thread at a time.
class TfTree {
 public:
  /// T_parent_child at a time. False, and nothing is changed, where the two are one frame, a name
  /// is empty, or `child` has a transform of that very stamp.
  bool add(std::string_view parent, std::string_view child, Stamp stamp, const RigidPose& pose);
  bool add_static(std::string_view parent, std::string_view child, const RigidPose& pose);

  /// T_target_source at a time: each transform on the path interpolated to it, none across more
  /// than `max_gap_s`.
  [[nodiscard]] tl::expected<Transform, LookupFailure> lookup(std::string_view target,
                                                              std::string_view source, Stamp stamp,
                                                              double max_gap_s) const;

  /// Whether a path between two frames is known, at whatever times; what is missing otherwise.
  [[nodiscard]] std::optional<LookupFailure> missing_path(std::string_view target,
                                                          std::string_view source) const;

  /// Frames that have no parent, by name.
  [[nodiscard]] std::vector<std::string> roots() const;

  /// Forgets what no lookup at `stamp` or later needs.
  void forget_before(Stamp stamp);

 private:
  struct Placement {
    std::string parent;
    RigidPose pose;
  };
  struct FrameHistory {
    std::optional<Placement> fixed;
    TimeSeries<Placement> moving;
  };
  /// Frames from one up to where it ends, each with T_frame_first.
  struct Chain;
  using Step = tl::expected<Placement, LookupFailure>;

  FrameHistory* history(std::string_view parent, std::string_view child);
  [[nodiscard]] Step placement(const std::string& frame, const FrameHistory& history, Stamp stamp,
                               double max_gap_s) const;
  /// Climbs from `frame` as far as `step` says where it stands, at most to `until`.
  template <class StepOf>
  [[nodiscard]] Chain climb(const std::string& frame, const Chain* until, StepOf&& step) const;
  template <class StepOf>
  [[nodiscard]] tl::expected<Transform, LookupFailure> path(std::string_view target,
                                                            std::string_view source,
                                                            StepOf&& step) const;

  std::map<std::string, FrameHistory, std::less<>> frames_;  ///< Parents as well.
};

/// Positions of named joints over time, joint by joint: messages may tell of some of them only, as
/// those of an arm and of a head do. One thread at a time.
class JointHistory {
 public:
  /// Position in m or rad. False where it is not finite, or the joint has one of that very stamp.
  bool add(std::string_view joint, Stamp stamp, double position);

  /// Of `joints`, those of which nothing is known, in their order.
  [[nodiscard]] std::vector<std::string> missing(std::span<const Joint> joints) const;
  /// The names of those of which something is, sorted.
  [[nodiscard]] std::vector<std::string> names() const;

  /// A joint's position at a time, linear between those around it; a continuous joint takes the
  /// shorter way round. None is extrapolated, and none is taken across more than `max_gap_s`.
  [[nodiscard]] tl::expected<double, LookupFailure> position(const Joint& joint, Stamp stamp,
                                                             double max_gap_s) const;

  /// Forgets what no lookup at `stamp` or later needs.
  void forget_before(Stamp stamp);

 private:
  std::map<std::string, TimeSeries<double>, std::less<>> joints_;
};

}  // namespace sidestep::ros_messages
