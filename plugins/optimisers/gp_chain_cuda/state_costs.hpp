#pragma once

#include "chain_problem.hpp"

namespace sidestep::gp_chain_cuda {

/// Signed clearance of a point and its gradient.
struct Clearance {
  double distance_m;
  Vec3 gradient;
};

namespace detail {

/// Where a point lies along one axis: between two voxel centres.
struct AxisPlace {
  int low, high, nearest;
  double fraction;
  double beyond;  ///< Voxels beyond the outermost centre.
};

SIDESTEP_HOST_DEVICE inline AxisPlace place_of(double at_m, double origin_m, double per_m,
                                               int size) {
  const double position = (at_m - origin_m) * per_m - 0.5;
  const double clamped = cuda::least_of(cuda::most_of(position, 0.0), size - 1.0);
  const int low = cuda::least_of(static_cast<int>(clamped), cuda::most_of(0, size - 2));
  const double beyond = position - clamped;
  return {low, cuda::least_of(low + 1, size - 1), static_cast<int>(clamped + 0.5), clamped - low,
          beyond < 0.0 ? -beyond : beyond};
}

SIDESTEP_HOST_DEVICE inline std::size_t voxel_at(const FieldOnDevice& field, int x, int y, int z) {
  constexpr int kSide = 16;
  const int block = x / kSide + field.blocks.x * (y / kSide + field.blocks.y * (z / kSide));
  const int place = x % kSide + kSide * (y % kSide + kSide * (z % kSide));
  return static_cast<std::size_t>(block) * (kSide * kSide * kSide) +
         static_cast<std::size_t>(place);
}

SIDESTEP_HOST_DEVICE inline bool is_known(const FieldOnDevice& field, int x, int y, int z) {
  const std::size_t voxel = voxel_at(field, x, y, z);
  return ((field.known[voxel / 16] >> (voxel % 16)) & 1u) != 0;
}

SIDESTEP_HOST_DEVICE inline double from_to(double a, double b, double fraction) {
  return a + fraction * (b - a);
}

/// Trilinear interpolation, as DenseField::query().
SIDESTEP_HOST_DEVICE inline Clearance interpolate(const FieldOnDevice& field, const AxisPlace& x,
                                                  const AxisPlace& y, const AxisPlace& z) {
  const auto at = [&](int i, int j, int k) {
    return static_cast<double>(field.distances_m[voxel_at(field, i, j, k)]);
  };
  // Along x first: values and slopes at the four edges.
  const double a00 = at(x.low, y.low, z.low), a10 = at(x.high, y.low, z.low);
  const double a01 = at(x.low, y.high, z.low), a11 = at(x.high, y.high, z.low);
  const double b00 = at(x.low, y.low, z.high), b10 = at(x.high, y.low, z.high);
  const double b01 = at(x.low, y.high, z.high), b11 = at(x.high, y.high, z.high);
  const double a0 = from_to(a00, a10, x.fraction), a1 = from_to(a01, a11, x.fraction);
  const double b0 = from_to(b00, b10, x.fraction), b1 = from_to(b01, b11, x.fraction);
  const double a = from_to(a0, a1, y.fraction), b = from_to(b0, b1, y.fraction);
  const double per_m = 1.0 / field.resolution_m;
  const Vec3 slope{from_to(from_to(a10 - a00, a11 - a01, y.fraction),
                           from_to(b10 - b00, b11 - b01, y.fraction), z.fraction),
                   from_to(a1 - a0, b1 - b0, z.fraction), b - a};
  return {from_to(a, b, z.fraction),
          {x.beyond > 0.0 ? 0.0 : per_m * slope.x, y.beyond > 0.0 ? 0.0 : per_m * slope.y,
           z.beyond > 0.0 ? 0.0 : per_m * slope.z}};
}

/// How far a coordinate must go to be in [low, high].
SIDESTEP_HOST_DEVICE inline double inwards(double at, double low, double high) {
  return at < low ? low - at : at > high ? high - at : 0.0;
}

}  // namespace detail

/// What query_with_policy() says of a point.
SIDESTEP_HOST_DEVICE inline Clearance clearance_at(const FieldOnDevice& field, const Vec3& p_m) {
  if (!(p_m.x - p_m.x == 0.0 && p_m.y - p_m.y == 0.0 && p_m.z - p_m.z == 0.0)) {
    return {cuda::kNaN, {}};
  }
  const double per_m = 1.0 / field.resolution_m;
  const auto x = detail::place_of(p_m.x, field.origin_m.x, per_m, field.size_vox.x);
  const auto y = detail::place_of(p_m.y, field.origin_m.y, per_m, field.size_vox.y);
  const auto z = detail::place_of(p_m.z, field.origin_m.z, per_m, field.size_vox.z);
  if (cuda::most_of(x.beyond, cuda::most_of(y.beyond, z.beyond)) > 0.5) {
    if (!field.outside_is_occupied) return {cuda::kInfinity, {}};
    const Vec3 upper_m =
        field.origin_m + field.resolution_m * Vec3{static_cast<double>(field.size_vox.x),
                                                   static_cast<double>(field.size_vox.y),
                                                   static_cast<double>(field.size_vox.z)};
    const Vec3 in{detail::inwards(p_m.x, field.origin_m.x, upper_m.x),
                  detail::inwards(p_m.y, field.origin_m.y, upper_m.y),
                  detail::inwards(p_m.z, field.origin_m.z, upper_m.z)};
    const double outside_m = norm(in);
    return {-outside_m, outside_m > 0.0 ? (1.0 / outside_m) * in : Vec3{}};
  }
  Clearance found = detail::interpolate(field, x, y, z);
  if (field.unknown_is_occupied && found.distance_m > 0.0 &&
      !detail::is_known(field, x.nearest, y.nearest, z.nearest)) {
    found.distance_m = 0.0;
  }
  return found;
}

/// Residuals of where a link is and, of each, its derivative by the link's motion as a force and a
/// moment about the world's origin, as sidestep's LinkCost has them.
struct LinkResiduals {
  int count = 0;
  double residual[6];
  Vec3 force[6];
  Vec3 moment[6];

  SIDESTEP_HOST_DEVICE void add(double value, const Vec3& by_point, const Vec3& by_turn) {
    residual[count] = value;
    force[count] = by_point;
    moment[count++] = by_turn;
  }
};

namespace detail {

SIDESTEP_HOST_DEVICE inline Vec3 vector_at(const double* numbers) {
  return {numbers[0], numbers[1], numbers[2]};
}
SIDESTEP_HOST_DEVICE inline Mat3 rotation_at(const double* numbers) {
  return {vector_at(numbers), vector_at(numbers + 3), vector_at(numbers + 6)};
}

}  // namespace detail

/// `numbers`: of a kLinkPose.
SIDESTEP_HOST_DEVICE inline LinkResiduals link_pose_residuals(const double* numbers,
                                                              const Pose& body) {
  const Mat3 R_world_target = detail::rotation_at(numbers);
  const Vec3 p_world_target = detail::vector_at(numbers + 9);
  const Mat3 R = body.R * detail::rotation_at(numbers + 12);
  const Vec3 p = body.R * detail::vector_at(numbers + 21) + body.p;
  const double position_weight = numbers[24], rotation_weight = numbers[25];
  const Vec3 axes[3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
  LinkResiduals out;
  if (position_weight > 0.0) {
    for (const Vec3& axis : axes) {
      const Vec3 force = position_weight * axis;
      out.add(position_weight * dot(axis, p - p_world_target), force, cross(p, force));
    }
  }
  if (rotation_weight > 0.0) {
    const Vec3 v = rotation_vector(transposed_times(R_world_target, R));
    const double angle = norm(v), square = angle * angle;
    // (1 - (angle / 2) cot(angle / 2)) / angle^2, of the inverse of SO(3)'s left Jacobian.
    const double factor = angle < 1e-2 ? 1.0 / 12.0 + square / 720.0
                                       : (1.0 - 0.5 * angle / tan(0.5 * angle)) / square;
    for (const Vec3& axis : axes) {
      const Vec3 turned = cross(v, axis);
      const Vec3 column = axis + 0.5 * turned + factor * cross(v, turned);
      out.add(rotation_weight * dot(axis, v), {}, rotation_weight * (R_world_target * column));
    }
  }
  return out;
}

/// `numbers`: of a kLinkAxis.
SIDESTEP_HOST_DEVICE inline LinkResiduals link_axis_residuals(const double* numbers, double weight,
                                                              const Pose& body) {
  constexpr double kOpposite = 1e-9;  // a sine: less, and the way back has no direction
  constexpr double kPi = 3.14159265358979323846;
  const Vec3 axis = body.R * detail::vector_at(numbers);
  const Vec3 axis_world = detail::vector_at(numbers + 3);
  const Vec3 across[2] = {detail::vector_at(numbers + 6), detail::vector_at(numbers + 9)};
  const double c = dot(axis, axis_world);
  const double s = norm(cross(axis, axis_world));
  LinkResiduals out;
  if (c < 0.0 && s < kOpposite) {
    out.add(weight * kPi, {}, -weight * cross(axis, across[0]));
    out.add(0.0, {}, {});
    return out;
  }
  const double angle = atan2(s, c), square = angle * angle;
  const bool is_small = angle < 1e-2;
  // angle / sin(angle), and its derivative by cos(angle).
  const double ratio = is_small ? 1.0 + square / 6.0 + 7.0 * square * square / 360.0 : angle / s;
  const double slope = is_small ? -1.0 / 3.0 - 2.0 * square / 15.0 : (angle * c - s) / (s * s * s);
  for (const Vec3& direction : across) {
    const double along = dot(axis, direction);
    out.add(weight * ratio * along, {},
            weight * (ratio * cross(axis, direction) + slope * along * cross(axis, axis_world)));
  }
  return out;
}

/// R Rz(angle).
SIDESTEP_HOST_DEVICE inline Mat3 turned_about_z(const Mat3& R, double angle) {
  const double s = sin(angle), c = cos(angle);
  return {c * R.x + s * R.y, c * R.y - s * R.x, R.z};
}

/// Places all bodies of a robot in one configuration, world frame.
SIDESTEP_HOST_DEVICE inline void place_bodies(const ChainProblem& problem, const double* q,
                                              Pose* bodies) {
  for (int b = 0; b < problem.bodies; ++b) {
    const Body& body = problem.body[b];
    Pose pose = body.T_parent_joint;
    if (body.parent >= 0) {
      const Pose& parent = bodies[body.parent];
      pose = {parent.R * pose.R, parent.R * pose.p + parent.p};
    }
    if (body.joint >= 0) {
      const double value = body.multiplier * q[body.joint] + body.offset;
      if (body.motion == Motion::kRotation) {
        pose.R = turned_about_z(pose.R, value);
      } else {
        pose.p = pose.p + value * pose.R.z;
      }
    }
    bodies[b] = pose;
  }
}

/// Maps a force on a body onto joints, as RobotModel::pull_back(). `moment`: about the world's
/// origin. row: one number a joint.
SIDESTEP_HOST_DEVICE inline void pull_back(const ChainProblem& problem, const Pose* bodies,
                                           int body, const Vec3& force, const Vec3& moment,
                                           double* row) {
  for (int j = 0; j < problem.dof; ++j) row[j] = 0.0;
  for (int b = body; b >= 0; b = problem.body[b].parent) {
    const Body& mover = problem.body[b];
    if (mover.joint < 0) continue;
    const Pose& pose = bodies[b];
    const double work = mover.motion == Motion::kRotation
                            ? dot(pose.R.z, moment - cross(pose.p, force))
                            : dot(pose.R.z, force);
    row[mover.joint] += mover.multiplier * work;
  }
}

/// What the costs of one state add to the normal equations: J^T J of positions (the lower half, row
/// by row) and of velocities, of which no cost couples two, and J^T r of both.
template <int kMaxDof>
struct StateShare {
  double hessian[kMaxDof * (kMaxDof + 1) / 2];
  double gradient[kMaxDof];
  double velocity_hessian[kMaxDof];
  double velocity_gradient[kMaxDof];

  SIDESTEP_HOST_DEVICE void clear(int dof) {
    for (int k = 0; k < dof * (dof + 1) / 2; ++k) hessian[k] = 0.0;
    for (int j = 0; j < dof; ++j) gradient[j] = velocity_hessian[j] = velocity_gradient[j] = 0.0;
  }
  SIDESTEP_HOST_DEVICE void add_row(int dof, const double* row, double residual) {
    int k = 0;
    for (int r = 0; r < dof; ++r) {
      gradient[r] += row[r] * residual;
      for (int c = 0; c <= r; ++c, ++k) hessian[k] += row[r] * row[c];
    }
  }
  SIDESTEP_HOST_DEVICE void add_position(int joint, double entry, double residual) {
    hessian[joint * (joint + 1) / 2 + joint] += entry * entry;
    gradient[joint] += entry * residual;
  }
  SIDESTEP_HOST_DEVICE void add_velocity(int joint, double entry, double residual) {
    velocity_hessian[joint] += entry * entry;
    velocity_gradient[joint] += entry * residual;
  }

  /// Writes ChainProblem::share_size() numbers.
  SIDESTEP_HOST_DEVICE void store(int dof, double* to) const {
    const int lower = dof * (dof + 1) / 2;
    for (int k = 0; k < lower; ++k) to[k] = hessian[k];
    for (int j = 0; j < dof; ++j) {
      to[lower + j] = gradient[j];
      to[lower + dof + j] = velocity_hessian[j];
      to[lower + 2 * dof + j] = velocity_gradient[j];
    }
  }
};

/// The same where it was stored.
struct StoredShare {
  const double* numbers;
  int dof;

  [[nodiscard]] SIDESTEP_HOST_DEVICE double hessian(int r, int c) const {
    return r < c ? numbers[c * (c + 1) / 2 + r] : numbers[r * (r + 1) / 2 + c];
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE double gradient(int j) const { return numbers[lower() + j]; }
  [[nodiscard]] SIDESTEP_HOST_DEVICE double velocity_hessian(int j) const {
    return numbers[lower() + dof + j];
  }
  [[nodiscard]] SIDESTEP_HOST_DEVICE double velocity_gradient(int j) const {
    return numbers[lower() + 2 * dof + j];
  }

 private:
  [[nodiscard]] SIDESTEP_HOST_DEVICE int lower() const { return dof * (dof + 1) / 2; }
};

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
