#pragma once

#include <limits>
#include <string>
#include <vector>

#include <sidestep/planning/validity_check.hpp>

#include "clearance_prover.hpp"

namespace sidestep {

/// Keeps the worst violation of each subject and kind, and turns them into a verdict.
class ViolationLedger {
 public:
  void add(Violation violation);
  [[nodiscard]] bool empty() const noexcept { return violations_.empty(); }
  /// The earliest time of all that were added; infinity if none was.
  [[nodiscard]] double first_s() const noexcept { return first_s_; }
  /// Worst first: collisions, self-collisions, limits, unproven; the larger amount first.
  [[nodiscard]] std::vector<Violation> sorted() const;

 private:
  std::vector<Violation> violations_;
  double first_s_ = std::numeric_limits<double>::infinity();
};

inline constexpr const char* kObstacle = "an obstacle";
inline constexpr const char* kUnknownSpace = "unknown space";
/// kObstacle, or what else a point is in that counts as occupied under the policy.
[[nodiscard]] std::string obstacle_name(FieldStatus status, const SpacePolicy& space);

/// The violation that a reading of a sphere or of a pair of links amounts to.
[[nodiscard]] Violation violation_of(const ClearanceProver& prover, int item,
                                     const ClearanceReading& reading, double time_s);
/// An item whose motion could not be shown clear.
[[nodiscard]] Violation unproven(const ClearanceProver& prover, int item,
                                 const Shortfall& shortfall, double time_s);

/// "its upper limit of 2.617 rad" and the like; `per` is "", "/s" or "/s^2".
[[nodiscard]] std::string limit_name(const Joint& joint, std::string_view which, double value,
                                     std::string_view per);

}  // namespace sidestep
