#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep {

/// How often the collision shapes of two links touch over random configurations.
struct PairStatistics {
  enum class Verdict {
    kChecked,   ///< Touch sometimes.
    kAdjacent,  ///< Only one planned joint lies between them.
    kAlways,    ///< Touch in nearly every configuration.
    kNever,     ///< Touch in none.
  };
  int a = 0;  ///< Link indices, lower first.
  int b = 0;
  int shapes_touch = 0;   ///< Number of samples; the shapes padded by the margin.
  int spheres_touch = 0;  ///< Number of samples.
  Verdict verdict = Verdict::kChecked;
};

struct SamplingOptions {
  int samples = 20000;
  double margin_m = 0.01;      ///< Half of it is added to each shape.
  double always_share = 0.95;  ///< Of the samples, from which on a pair counts as always touching.
  std::uint64_t seed = 1;
};

/// Samples configurations within the limits and tells every pair of links that have shapes (or,
/// lacking shapes, spheres) and can move against each other apart. FCL on the URDF's own shapes.
/// `goes_on` is asked before each of them, whether there are to be more.
[[nodiscard]] std::vector<PairStatistics> sample_pairs(
    const KinematicTree& tree, const SamplingOptions& options,
    const std::function<bool(int sample)>& goes_on = {});

/// Pairs of links whose shapes, unpadded, touch in one configuration.
[[nodiscard]] std::vector<std::pair<int, int>> touching_pairs(const KinematicTree& tree,
                                                              std::span<const double> q);

/// Of these pairs of links those whose spheres touch in one configuration.
[[nodiscard]] std::vector<std::pair<int, int>> touching_spheres(
    const KinematicTree& tree, std::span<const std::pair<int, int>> pairs,
    std::span<const double> q);

/// The profile's `self_collision` block that checks these pairs.
[[nodiscard]] std::string self_collision_block(const RobotDescription& robot,
                                               const std::vector<PairStatistics>& pairs,
                                               const SamplingOptions& options);

/// A profile's text with its `self_collision` block replaced, or with one at its end. All else,
/// comments included, stays as it is.
[[nodiscard]] std::string with_self_collision(const std::string& profile, const std::string& block);

}  // namespace sidestep
