#include "describe.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/cost_form.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/robot/kinematic_tree.hpp>
#include <sidestep/trajectory/gp_prior.hpp>

namespace sidestep::gp_chain_cuda {
namespace {

/// What kernels do not know, and the way out.
tl::unexpected<Error> unknown(std::string message) {
  return fail(ErrorCode::kInvalidArgument, std::move(message), "optimiser gp_chain_cuda",
              "fallback: cpu solves such problems with gp_chain");
}

Vec3 vec3(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

At at_of(Placement placement) {
  switch (placement) {
    case Placement::kStart: return At::kStart;
    case Placement::kGoal: return At::kGoal;
    case Placement::kSupport: return At::kSupport;
    case Placement::kSupportAndInterpolated: return At::kEverywhere;
  }
  return At::kEverywhere;
}

/// Takes the terms of a problem apart, one after the other.
class TermReader {
 public:
  TermReader(const Problem& problem, const KinematicTree& tree, DescribedProblem& out)
      : problem_(problem), tree_(tree), robot_(tree.description()), out_(out) {}

  Result<void> read(const CostTerm& term) {
    const std::string name(term.cost->name());
    const auto* described = dynamic_cast<const HasCostForm*>(term.cost.get());
    if (described == nullptr) {
      return unknown("the cost '" + name + "' does not say what it is made of (HasCostForm)");
    }
    term_ = {.at = at_of(term.placement), .numbers = static_cast<int>(numbers().size())};
    const CostForm form = described->form();
    auto ok = std::visit([&](const auto& of) { return put(of); }, form);
    if (!ok) {
      ok.error().message = "the cost '" + name + "': " + ok.error().message;
      return ok;
    }
    out_.chain.problem.term[out_.chain.problem.terms++] = term_;
    return {};
  }

 private:
  [[nodiscard]] std::vector<double>& numbers() { return out_.chain.numbers; }

  template <class Values>
  void add(const Values& values) {
    for (const double value : values) numbers().push_back(value);
  }
  void add(const Eigen::Vector3d& v) { numbers().insert(numbers().end(), v.data(), v.data() + 3); }
  void add(const Eigen::Matrix3d& m) { numbers().insert(numbers().end(), m.data(), m.data() + 9); }

  Result<void> check_robot(const std::shared_ptr<const RobotModel>& robot) const {
    if (robot == problem_.robot) return {};
    return unknown("it is of another robot than the problem");
  }

  Result<void> put(const ObstacleForm& form) {
    SIDESTEP_TRY(check_robot(form.robot));
    auto field = std::dynamic_pointer_cast<const DenseField>(form.field);
    if (!field) return unknown("its field is not made of voxels");
    if (out_.field) return unknown("a second one of its kind is not known");
    const FieldInfo& info = field->info();
    const Eigen::Vector3i& size = info.grid.size_vox;
    const Eigen::Vector3i blocks = block_counts(info.grid);
    out_.field_shape = {.size_vox = {size.x(), size.y(), size.z()},
                        .blocks = {blocks.x(), blocks.y(), blocks.z()},
                        .origin_m = vec3(info.grid.origin_m),
                        .resolution_m = info.grid.resolution_m,
                        .unknown_is_occupied = form.space.unknown == Space::kOccupied,
                        .outside_is_occupied = form.space.outside == Space::kOccupied};
    out_.field = std::move(field);
    term_.kind = Term::Kind::kObstacle;
    term_.weight = 1.0 / form.sigma_m;
    for (const CollisionSphere& sphere : robot_.spheres) {
      numbers().push_back(form.epsilon_m + sphere.radius_m);
    }
    return {};
  }

  Result<void> put(const FloorForm& form) {
    SIDESTEP_TRY(check_robot(form.robot));
    term_.kind = Term::Kind::kFloor;
    term_.weight = 1.0 / form.sigma_m;
    std::vector<double> begins_m(robot_.spheres.size(), -std::numeric_limits<double>::infinity());
    for (const int sphere : spheres_above(form.floor, robot_)) {
      const auto s = static_cast<std::size_t>(sphere);
      begins_m[s] = form.floor.height_m + form.epsilon_m + robot_.spheres[s].radius_m;
    }
    add(begins_m);
    return {};
  }

  Result<void> put(const SelfCollisionForm& form) {
    SIDESTEP_TRY(check_robot(form.robot));
    ChainDescription& chain = out_.chain;
    term_.kind = Term::Kind::kSelfCollision;
    term_.weight = 1.0 / form.sigma_m;
    term_.numbers = static_cast<int>(chain.pair_ends.size());
    term_.count = static_cast<int>(robot_.self_collision_pairs.size());
    const int spheres = static_cast<int>(robot_.spheres.size());
    const auto sphere = [&](int s) -> const CollisionSphere& {
      return robot_.spheres[static_cast<std::size_t>(s)];
    };
    for (const auto& [first, second] : robot_.self_collision_pairs) {
      for (int a = 0; a < spheres; ++a) {
        for (int b = 0; b < spheres && sphere(a).link == first; ++b) {
          if (sphere(b).link != second) continue;
          chain.pairs.push_back({a, b, form.epsilon_m + (sphere(a).radius_m + sphere(b).radius_m)});
        }
      }
      chain.pair_ends.push_back(static_cast<std::int32_t>(chain.pairs.size()));
    }
    return {};
  }

  Result<void> put(const LimitForm& form) {
    term_.kind = form.of_velocity ? Term::Kind::kVelocityLimit : Term::Kind::kPositionLimit;
    term_.weight = 1.0 / form.sigma;
    add(form.lower);
    add(form.upper);
    return {};
  }

  Result<void> put(const TargetForm& form) {
    term_.kind = Term::Kind::kTarget;
    term_.numbers = static_cast<int>(out_.own_numbers.size());
    for (const auto* values : {&form.q, &form.q_weights, &form.qdot, &form.qdot_weights}) {
      out_.own_numbers.insert(out_.own_numbers.end(), values->begin(), values->end());
    }
    return {};
  }

  Result<void> put(const LinkPoseForm& form) {
    SIDESTEP_TRY(check_robot(form.robot));
    if (form.targets.size() > 1 || !form.within_m.isZero()) {
      return unknown("alternatives and regions of an end effector's goal are not known to it");
    }
    const TreeLink link = tree_.link_in_body(form.link);
    term_.kind = Term::Kind::kLinkPose;
    term_.body = link.body;
    add(Eigen::Matrix3d(form.targets.front().linear()));
    add(Eigen::Vector3d(form.targets.front().translation()));
    add(link.R_body_link);
    add(link.p_body_link);
    add(std::vector{form.position_weight, form.rotation_weight});
    return {};
  }

  Result<void> put(const LinkAxisForm& form) {
    SIDESTEP_TRY(check_robot(form.robot));
    const TreeLink link = tree_.link_in_body(form.link);
    term_.kind = Term::Kind::kLinkAxis;
    term_.body = link.body;
    term_.weight = form.weight;
    add(Eigen::Vector3d(link.R_body_link * form.axis_link));
    add(form.axis_world);
    add(form.across[0]);
    add(form.across[1]);
    return {};
  }

  const Problem& problem_;
  const KinematicTree& tree_;
  const RobotDescription& robot_;
  DescribedProblem& out_;
  Term term_;
};

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
  SIDESTEP_TRY(check_count(idx(tree.description().dof()), kLargestDof, "joints"));
  SIDESTEP_TRY(check_count(tree.bodies().size(), kLargestBodies, "moving links"));
  SIDESTEP_TRY(check_count(tree.spheres_on_bodies().size(), kLargestSpheres, "spheres"));
  return check_count(problem.terms.size(), kLargestTerms, "cost terms");
}

bool is_held(const Problem& problem, Placement end) {
  return std::ranges::find(problem.terms, end, &CostTerm::placement) == problem.terms.end();
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
  TermReader reader(problem, *tree, out);
  for (const CostTerm& term : problem.terms) SIDESTEP_TRY(reader.read(term));
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
