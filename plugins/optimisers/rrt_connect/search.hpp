#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <sidestep/core/time.hpp>

#include "checker.hpp"
#include "joint_space.hpp"
#include "random.hpp"
#include "tree.hpp"

namespace sidestep::rrt_connect {

struct SearchSettings {
  double range_m = 0.3;         ///< Longest extension, in the lengths of the space.
  double domain = 8.0;          ///< Of configurations that could not be extended, in ranges.
  double resolution_m = 0.005;  ///< Of Checker.
};

/// RRT-Connect: two trees, from the start and from the goals, grow towards each other (Kuffner and
/// LaValle, ICRA 2000). The smaller tree grows. A configuration that could not be extended draws
/// only samples within its domain, a ball that each further failure makes smaller and each success
/// larger (Jaillet et al., IROS 2005). Extensions are looked at where they end, eight at once,
/// which finds out most of those that are blocked; those that are left, over all of their length.
/// Extensions are such as the space's steering makes them.
class Search {
 public:
  /// `space`, `checker` and `deadline`, after which nothing is clear, must outlive it.
  Search(const joint_paths::JointSpace& space, std::span<const double> start,
         joint_paths::Checker& checker, const SearchSettings& settings, std::uint64_t seed,
         const Deadline& deadline);

  /// One round: extends a tree by up to eight samples; a path of dof values a vertex, from the
  /// start to a goal, if the trees have met. Allocates.
  [[nodiscard]] std::optional<std::vector<double>> grow();

  /// Drawn so far.
  [[nodiscard]] std::int64_t samples() const noexcept { return samples_; }
  /// What it cost so far: how often the checker was asked.
  [[nodiscard]] std::int64_t looks() const noexcept { return looks_; }

 private:
  struct Side {
    Tree tree;
    std::vector<double> domain_m = {};  ///< By number; infinite where no extension has failed.

    std::size_t add(std::span<const double> u, std::size_t parent);
  };

  [[nodiscard]] std::size_t draw(const Side& side);
  void sample_space();
  void sample_domain(const Side& side);
  [[nodiscard]] std::optional<std::size_t> connect(Side& side, std::span<const double> u);
  [[nodiscard]] std::optional<std::size_t> extend(Side& side, std::size_t from,
                                                  std::span<const double> u, bool is_blocked);
  [[nodiscard]] unsigned find_blocked(std::span<const double> u);
  [[nodiscard]] bool is_clear(const joint_paths::Way& way);
  [[nodiscard]] std::vector<double> path(std::size_t from_start, std::size_t from_goal) const;

  const joint_paths::JointSpace& space_;
  joint_paths::Checker& checker_;
  SearchSettings settings_;
  const Deadline& deadline_;
  std::size_t dof_;
  std::vector<double> start_;
  Random random_;
  std::vector<Side> sides_;  ///< Of the start, of the goals.
  std::size_t turn_ = 1;
  std::int64_t samples_ = 0;
  std::int64_t looks_ = 0;
  std::vector<double> sample_;
  std::vector<double> drawn_;  ///< Ends of extensions, and where they begin.
  std::vector<std::size_t> drawn_from_;
  std::vector<double> steps_;  ///< Of connect().
  joint_paths::Way way_;       ///< That draw() and connect() go along.
  joint_paths::Way edge_;      ///< Of extend().
  std::vector<double> q_;
  std::vector<double> q_to_;
};

}  // namespace sidestep::rrt_connect
