#include "describe_terms.hpp"

#include <limits>
#include <utility>

#include <sidestep/planning/cost_form.hpp>
#include <sidestep/planning/costs.hpp>

namespace sidestep::gp_chain_cuda {
namespace {

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
    const TreeLink link = tree_.link_in_body(form.link);
    term_.kind = Term::Kind::kLinkPose;
    term_.body = link.body;
    add(form.R_world_target);
    add(form.p_world_target);
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

}  // namespace

tl::unexpected<Error> unknown(std::string message) {
  return fail(ErrorCode::kInvalidArgument, std::move(message), "optimiser gp_chain_cuda",
              "fallback: cpu solves such problems with gp_chain");
}

Result<void> describe_terms(const Problem& problem, const KinematicTree& tree,
                            DescribedProblem& out) {
  TermReader reader(problem, tree, out);
  for (const CostTerm& term : problem.terms) {
    SIDESTEP_TRY(reader.read(term));
  }
  return {};
}

}  // namespace sidestep::gp_chain_cuda
