#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <tl/expected.hpp>

#include <sidestep/core/time.hpp>
#include <sidestep/geometry/transform.hpp>

#include "rigid_pose.hpp"
#include "time_series.hpp"

namespace sidestep::ros_messages {

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

}  // namespace sidestep::ros_messages
