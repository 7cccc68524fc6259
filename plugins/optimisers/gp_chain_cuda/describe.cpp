#include "describe.hpp"

#include <cmath>
#include <string>

#include <sidestep/trajectory/gp_prior.hpp>

#include "describe_terms.hpp"

namespace sidestep::gp_chain_cuda {
namespace {

Result<void> check_count(std::size_t count, int largest, const std::string& of) {
  if (count <= static_cast<std::size_t>(largest)) return {};
  return unknown(std::to_string(count) + " " + of + " are more than the " +
                 std::to_string(largest) + " that there is room for");
}

Mat3 mat3(const Eigen::Matrix3d& m) { return {vec3(m.col(0)), vec3(m.col(1)), vec3(m.col(2))}; }

Motion motion_of(TreeJoint::Motion motion) {
  switch (motion) {
    case TreeJoint::Motion::kFixed: return Motion::kFixed;
    case TreeJoint::Motion::kRotation: return Motion::kRotation;
    case TreeJoint::Motion::kTranslation: return Motion::kTranslation;
  }
  return Motion::kFixed;
}

/// The 2x2 blocks of the GP prior of a joint with Qc = 1 (docs/numerics.md).
struct PriorMatrices {
  Eigen::Matrix2d information;  ///< Q^-1: at the end of an interval,
  Eigen::Matrix2d own;          ///< at its beginning,
  Eigen::Matrix2d across;       ///< and between them: rows of the end.

  explicit PriorMatrices(const GpPrior& prior) {
    Eigen::Matrix2d phi;
    phi << 1.0, prior.dt_s(), 0.0, 1.0;
    information = prior.whitening().transpose() * prior.whitening();
    own = phi.transpose() * information * phi;
    across = -information * phi;
  }
};

void describe_prior(const Problem& problem, ChainDescription& chain) {
  const GpPrior prior(problem.qc, problem.dt_s);
  const PriorMatrices matrices(prior);
  PriorBlocks& to = chain.problem.prior;
  const auto lower = [](const Eigen::Matrix2d& m, double(&out)[3]) {
    out[0] = m(0, 0);
    out[1] = m(1, 0);
    out[2] = m(1, 1);
  };
  lower(matrices.information, to.information);
  lower(matrices.own, to.own);
  for (int r = 0; r < 2; ++r) {
    for (int c = 0; c < 2; ++c) to.across[r][c] = matrices.across(r, c);
  }
  for (const double qc : problem.qc) chain.inverse_qc.push_back(1.0 / qc);
  for (int k = 1; k <= problem.interpolated_checks; ++k) {
    const auto at = prior.interpolation(k / (problem.interpolated_checks + 1.0));
    Interpolation& by = chain.interpolations.emplace_back();
    for (int row = 0; row < 2; ++row) {
      for (int part = 0; part < 2; ++part) {
        by.by[row][part] = at.lambda(row, part);
        by.by[row][2 + part] = at.psi(row, part);
      }
    }
  }
}

Result<void> check_sizes(const Problem& problem, const KinematicTree& tree) {
  Result<void> ok =
      check_count(static_cast<std::size_t>(tree.description().dof()), kLargestDof, "joints");
  if (ok) ok = check_count(tree.bodies().size(), kLargestBodies, "moving links");
  if (ok) ok = check_count(tree.spheres_on_bodies().size(), kLargestSpheres, "spheres");
  if (ok) ok = check_count(problem.terms.size(), kLargestTerms, "cost terms");
  return ok;
}

bool is_held(const Problem& problem, Placement end) {
  for (const CostTerm& term : problem.terms) {
    if (term.placement == end) return false;
  }
  return true;
}

}  // namespace

Result<DescribedProblem> describe(const Problem& problem) {
  const auto* tree = dynamic_cast<const KinematicTree*>(problem.robot.get());
  if (tree == nullptr) return unknown("the robot is not a KinematicTree, as those of URDF are");
  SIDESTEP_TRY(check_sizes(problem, *tree));
  DescribedProblem out;
  ChainProblem& sizes = out.chain.problem;
  sizes.dof = tree->description().dof();
  sizes.states = problem.support_states;
  sizes.checks = problem.interpolated_checks;
  sizes.dt_s = problem.dt_s;
  sizes.is_start_held = is_held(problem, Placement::kStart);
  sizes.is_goal_held = is_held(problem, Placement::kGoal);
  describe_prior(problem, out.chain);
  for (const TreeBody& body : tree->bodies()) {
    out.chain.bodies.push_back({body.parent,
                                motion_of(body.motion),
                                body.joint,
                                body.multiplier,
                                body.offset,
                                {mat3(body.R_parent_joint), vec3(body.p_parent_joint)}});
  }
  for (const TreeSphere& sphere : tree->spheres_on_bodies()) {
    out.chain.spheres.push_back({sphere.body, vec3(sphere.p_body)});
  }
  sizes.bodies = static_cast<int>(out.chain.bodies.size());
  sizes.spheres = static_cast<int>(out.chain.spheres.size());
  SIDESTEP_TRY(describe_terms(problem, *tree, out));
  sizes.own_numbers = static_cast<int>(out.own_numbers.size());
  return out;
}

SamplesOnHost describe_samples(const Problem& problem, double spread) {
  // The chain of one joint with Qc = 1, from which states are eliminated from the first one on:
  // A is what is left of a state's block, K what couples the next one to it.
  const PriorMatrices prior(GpPrior({}, problem.dt_s));
  const Eigen::Matrix2d& K = prior.across;
  const Eigen::Matrix2d block = prior.own + prior.information;
  SamplesOnHost out;
  out.steps.resize(static_cast<std::size_t>(problem.support_states));
  Eigen::Matrix2d A = block;
  for (int i = 1; i + 1 < problem.support_states; ++i) {
    const Eigen::Matrix2d inverse = A.inverse();
    const Eigen::Matrix2d G = A.llt().matrixL().toDenseMatrix().inverse().transpose();
    const Eigen::Matrix2d F = inverse * K.transpose();
    out.steps[static_cast<std::size_t>(i)] = {{G(0, 0), G(0, 1), G(1, 1)},
                                              {{F(0, 0), F(0, 1)}, {F(1, 0), F(1, 1)}}};
    A = block - K * inverse * K.transpose();
  }
  for (const double qc : problem.qc) out.deviations.push_back(spread * std::sqrt(qc));
  return out;
}

}  // namespace sidestep::gp_chain_cuda
