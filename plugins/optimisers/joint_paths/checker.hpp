#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include <sidestep/core/error.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/planning/validity_check.hpp>

namespace sidestep::joint_paths {

/// What shows configurations and straight motions in joint space clear. One thread at a time.
class Checker {
 public:
  virtual ~Checker() = default;

  /// The problem that what follows is about. Fails with kInvalidArgument, naming the option, where
  /// the problem has not what this checker looks at.
  [[nodiscard]] virtual Result<void> look_at(const Problem& problem) = 0;

  /// True if a configuration is clear. Limits are the caller's affair.
  [[nodiscard]] virtual bool is_clear(std::span<const double> q) = 0;
  /// Of at most kLanes finite configurations, one after the other in `q`, those that it finds
  /// blocked faster than by is_clear(), which may be none: bit i for configuration i.
  [[nodiscard]] virtual unsigned find_blocked(std::span<const double> q) = 0;
  /// True if the straight line between two is shown clear, ends included; what is not before
  /// nothing moves more than `resolution_m` between two looks counts as blocked.
  [[nodiscard]] virtual bool is_clear(std::span<const double> q_from, std::span<const double> q_to,
                                      double resolution_m) = 0;
  /// What is worst about a configuration that is not clear.
  [[nodiscard]] virtual std::optional<Violation> violation(std::span<const double> q) = 0;
};

/// By the name of `checker`: `field`, `primitives` or `octomap`.
[[nodiscard]] std::unique_ptr<Checker> make_checker(const std::string& name);

}  // namespace sidestep::joint_paths
