#pragma once

#include "field_sample.hpp"
#include "link_residuals.hpp"
#include "placement.hpp"
#include "state_share.hpp"

namespace sidestep::gp_chain_cuda {

/// The costs of one state of a chain. Each of its methods adds a term's rows to a share and returns
/// the sum of their squares; what they compute is documented with the costs of
/// sidestep/planning/costs.hpp.
template <int kMaxDof>
class StateCosts {
 public:
  /// `q`, `qdot`: dof each. `own_numbers`: the chain's.
  SIDESTEP_HOST_DEVICE StateCosts(const ChainProblem& problem, const double* own_numbers,
                                  const double* q, const double* qdot)
      : problem_(problem), own_numbers_(own_numbers), q_(q), qdot_(qdot) {
    share_.clear(problem.dof);
    place_bodies(problem, q, bodies_);
    for (int s = 0; s < problem.spheres; ++s) {
      const Sphere& sphere = problem.sphere[s];
      const Pose& body = bodies_[sphere.body];
      centres_m_[s] = body.R * sphere.p_body + body.p;
    }
  }

  /// Returns the cost, half the sum of squares.
  SIDESTEP_HOST_DEVICE double add(const Term& term) {
    switch (term.kind) {
      case Term::Kind::kObstacle: return 0.5 * add_obstacles(term);
      case Term::Kind::kFloor: return 0.5 * add_floor(term);
      case Term::Kind::kSelfCollision: return 0.5 * add_self_collisions(term);
      case Term::Kind::kPositionLimit: return 0.5 * add_limits(term, q_, false);
      case Term::Kind::kVelocityLimit: return 0.5 * add_limits(term, qdot_, true);
      case Term::Kind::kTarget: return 0.5 * add_targets(term);
      case Term::Kind::kLinkPose: return 0.5 * add_link_pose(term);
      case Term::Kind::kLinkAxis: return 0.5 * add_link_axis(term);
    }
    return 0.0;
  }

  [[nodiscard]] SIDESTEP_HOST_DEVICE const StateShare<kMaxDof>& share() const { return share_; }

 private:
  SIDESTEP_HOST_DEVICE double add_obstacles(const Term& term) {
    const double* reach_m = problem_.numbers + term.numbers;
    double sum = 0.0;
    for (int s = 0; s < problem_.spheres; ++s) {
      const Clearance clearance = clearance_at(problem_.field, centres_m_[s]);
      if (clearance.distance_m >= reach_m[s]) continue;  // keeps NaN
      sum += add_at_sphere(s, -term.weight * clearance.gradient,
                           term.weight * (reach_m[s] - clearance.distance_m));
    }
    return sum;
  }

  SIDESTEP_HOST_DEVICE double add_floor(const Term& term) {
    const double* begins_m = problem_.numbers + term.numbers;
    double sum = 0.0;
    for (int s = 0; s < problem_.spheres; ++s) {
      if (centres_m_[s].z >= begins_m[s] || begins_m[s] == -cuda::kInfinity) continue;
      sum +=
          add_at_sphere(s, {0.0, 0.0, -term.weight}, term.weight * (begins_m[s] - centres_m_[s].z));
    }
    return sum;
  }

  SIDESTEP_HOST_DEVICE double add_self_collisions(const Term& term) {
    double sum = 0.0;
    for (int links = term.numbers; links < term.numbers + term.count; ++links) {
      int closest = -1;
      double deepest_m = 0.0;
      const int begin = links == 0 ? 0 : problem_.pair_ends[links - 1];
      for (int k = begin; k < problem_.pair_ends[links]; ++k) {
        const SpherePair& pair = problem_.pairs[k];
        const Vec3 apart = centres_m_[pair.a] - centres_m_[pair.b];
        const double squared = dot(apart, apart);
        if (squared >= pair.reach_m * pair.reach_m) continue;
        const double hinge_m = pair.reach_m - sqrt(squared);
        if (hinge_m <= deepest_m) continue;  // keeps NaN
        deepest_m = hinge_m;
        closest = k;
      }
      if (closest >= 0) sum += add_pair(problem_.pairs[closest], term.weight, deepest_m);
    }
    return sum;
  }

  SIDESTEP_HOST_DEVICE double add_pair(const SpherePair& pair, double weight, double hinge_m) {
    const Vec3& a_m = centres_m_[pair.a];
    const Vec3& b_m = centres_m_[pair.b];
    const Vec3 apart = a_m - b_m;
    const double length_m = norm(apart);
    const Vec3 force = length_m > 0.0 ? (-weight / length_m) * apart : Vec3{};
    double first[kMaxDof], second[kMaxDof];
    pull_back(problem_, bodies_, problem_.sphere[pair.a].body, force, cross(a_m, force), first);
    pull_back(problem_, bodies_, problem_.sphere[pair.b].body, force, cross(b_m, force), second);
    for (int j = 0; j < problem_.dof; ++j) first[j] -= second[j];
    return add_row(first, weight * hinge_m);
  }

  SIDESTEP_HOST_DEVICE double add_limits(const Term& term, const double* values, bool of_velocity) {
    const double* lower = problem_.numbers + term.numbers;
    const double* upper = lower + problem_.dof;
    double sum = 0.0;
    for (int j = 0; j < problem_.dof; ++j) {
      const double below = lower[j] - values[j];
      const double above = values[j] - upper[j];
      if (below <= 0.0 && above <= 0.0) continue;
      sum += add_entry(j, of_velocity, above > below ? term.weight : -term.weight,
                       term.weight * cuda::most_of(above, below));
    }
    return sum;
  }

  SIDESTEP_HOST_DEVICE double add_targets(const Term& term) {
    const int d = problem_.dof;
    const double* numbers = own_numbers_ + term.numbers;
    double sum = 0.0;
    for (int j = 0; j < d; ++j) {
      const double weight = numbers[d + j], velocity_weight = numbers[3 * d + j];
      if (weight != 0.0) sum += add_entry(j, false, weight, weight * (q_[j] - numbers[j]));
      if (velocity_weight == 0.0) continue;
      sum += add_entry(j, true, velocity_weight, velocity_weight * (qdot_[j] - numbers[2 * d + j]));
    }
    return sum;
  }

  SIDESTEP_HOST_DEVICE double add_link_pose(const Term& term) {
    return add_link_rows(term,
                         link_pose_residuals(problem_.numbers + term.numbers, bodies_[term.body]));
  }
  SIDESTEP_HOST_DEVICE double add_link_axis(const Term& term) {
    return add_link_rows(term, link_axis_residuals(problem_.numbers + term.numbers, term.weight,
                                                   bodies_[term.body]));
  }
  SIDESTEP_HOST_DEVICE double add_link_rows(const Term& term, const LinkResiduals& rows) {
    double sum = 0.0;
    for (int k = 0; k < rows.count; ++k) {
      double row[kMaxDof];
      pull_back(problem_, bodies_, term.body, rows.force[k], rows.moment[k], row);
      sum += add_row(row, rows.residual[k]);
    }
    return sum;
  }

  /// A row that is a force at a sphere's centre.
  SIDESTEP_HOST_DEVICE double add_at_sphere(int sphere, const Vec3& force, double residual) {
    double row[kMaxDof];
    pull_back(problem_, bodies_, problem_.sphere[sphere].body, force,
              cross(centres_m_[sphere], force), row);
    return add_row(row, residual);
  }
  SIDESTEP_HOST_DEVICE double add_row(const double* row, double residual) {
    share_.add_row(problem_.dof, row, residual);
    return residual * residual;
  }
  SIDESTEP_HOST_DEVICE double add_entry(int joint, bool of_velocity, double entry,
                                        double residual) {
    if (of_velocity) {
      share_.add_velocity(joint, entry, residual);
    } else {
      share_.add_position(joint, entry, residual);
    }
    return residual * residual;
  }

  const ChainProblem& problem_;
  const double* own_numbers_;
  const double* q_;
  const double* qdot_;
  Pose bodies_[kLargestBodies];
  Vec3 centres_m_[kLargestSpheres];
  StateShare<kMaxDof> share_;
};

}  // namespace sidestep::gp_chain_cuda
