#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <tl/expected.hpp>

#include <sidestep/robot/robot_model.hpp>

#include "tf_tree.hpp"
#include "time_series.hpp"

namespace sidestep::ros_messages {

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
