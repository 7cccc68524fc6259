#pragma once

#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <sidestep/planning/problem.hpp>
#include <sidestep/planning/state_normals.hpp>
#include <sidestep/trajectory/gp_prior.hpp>

#include "body_chain.hpp"
#include "chain_system.hpp"
#include "prior_chain.hpp"

namespace sidestep {

/// What all terms of a problem say at one trajectory.
struct ChainEvaluation {
  std::vector<double> support;  ///< [q; qdot] of each support state, one after the other.
  StateNormals normals;         ///< Of every state, support and interpolated, in order of time.
  std::vector<double> terms;    ///< Cost of the GP prior, then of each term of the problem.
  double cost = 0.0;            ///< Their sum.
  bool has_normals = false;     ///< Else `normals` are in part or not at all there.
};

/// The cost of a chain of states: the GP prior and a problem's terms. Every term is evaluated at
/// all its states in one batch.
class ChainCosts {
 public:
  /// Takes up a problem, which must outlive what follows; `body`: the planar
  /// base whose body has the prior (BodyChain); nothing: all joints have. Returns
  /// whether its chain is another one than before: its size, its times or its prior; a system that
  /// was prepared must be so again.
  bool reset(const Problem& problem, const std::optional<BodyChain::Base>& body);

  [[nodiscard]] int states() const noexcept { return intervals_ + 1; }
  [[nodiscard]] int dof() const noexcept { return dof_; }
  [[nodiscard]] double dt_s() const noexcept { return problem_->dt_s; }

  /// Gives an evaluation the sizes of this problem.
  void resize(ChainEvaluation& evaluation) const;

  /// Takes up a problem that differs from the last one in its terms' costs only.
  void replace(const Problem& problem) noexcept { problem_ = &problem; }

  /// Fills in everything from evaluation.support; where it costs more than `normals_wanted_below`
  /// nothing but costs.
  void evaluate(ChainEvaluation& evaluation,
                double normals_wanted_below = std::numeric_limits<double>::infinity());
  /// The same where nothing has changed since but terms at one end, which is `kStart` or `kGoal`.
  void evaluate_end(ChainEvaluation& evaluation, Placement end);

  /// Gives a system the size of this problem, and what of H is the same at every trajectory.
  void prepare(ChainSystem& system) const;
  /// Adds the rest of the normal equations at an evaluated trajectory: b = -gradient.
  void assemble(const ChainEvaluation& evaluation, ChainSystem& system);

  /// `moved`: support states at which a system was assembled, plus a step; becomes what such a step
  /// leads to.
  void finish_step(std::span<const double> support, std::span<double> moved) const noexcept;

 private:
  struct States {
    std::vector<double> q, qdot;  ///< Reach kLanes beyond the last state.
    std::vector<double> times_s;
    void resize(int count, int dof, double spacing_s);
    [[nodiscard]] StateBatch batch(int first, int count, int dof) const noexcept;
  };

  void interpolate(std::span<const double> support);
  [[nodiscard]] double add_term(const CostTerm& term, StateNormals& normals);
  /// What a term costs at one support state.
  [[nodiscard]] double add_at(int support, const CostTerm& term, StateNormals& normals);

  const Problem* problem_ = nullptr;
  int dof_ = 0;
  int checks_ = 0;
  int intervals_ = 0;
  PriorChain prior_;
  std::optional<BodyChain> body_;
  std::vector<GpPrior::Interpolation> interpolations_;  ///< Of the checks of every interval.
  States support_, all_;
  AlignedArray ends_;  ///< Of an interval: positions and velocities of both, in whole lanes.
  Scratch scratch_;
};

}  // namespace sidestep
