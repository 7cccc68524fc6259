#include "sphere_states.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <variant>

namespace sidestep::plain_driver {
namespace {

double bound_m(const Box& box) { return 0.5 * box.size_m.norm(); }
double bound_m(const Cylinder& cylinder) {
  return std::hypot(cylinder.radius_m, 0.5 * cylinder.length_m);
}
double bound_m(const Sphere& sphere) { return sphere.radius_m; }
double bound_m(const Shape&) { return std::numeric_limits<double>::infinity(); }

template <class Kind>
PlacedShape<Kind> placed(const Kind& shape, const Transform& T_world_shape) {
  return {shape, T_world_shape.inverse(), T_world_shape.translation(), bound_m(shape)};
}

// Whether something comes nearer to p_shape than r_m > 0.

bool is_near(const Box& box, const Eigen::Vector3d& p_shape, double r_m) {
  const Eigen::Vector3d beyond_m = (p_shape.cwiseAbs() - 0.5 * box.size_m).cwiseMax(0.0);
  return beyond_m.squaredNorm() < r_m * r_m;
}

bool is_near(const Cylinder& cylinder, const Eigen::Vector3d& p_shape, double r_m) {
  const double above_m = std::abs(p_shape.z()) - 0.5 * cylinder.length_m;
  const double square_m2 = p_shape.head<2>().squaredNorm();
  const double reach_m = cylinder.radius_m + r_m;
  if (above_m >= r_m || square_m2 >= reach_m * reach_m) return false;
  if (above_m <= 0.0) return true;
  const double beside_m = std::max(std::sqrt(square_m2) - cylinder.radius_m, 0.0);
  return beside_m * beside_m + above_m * above_m < r_m * r_m;
}

bool is_near(const Sphere& sphere, const Eigen::Vector3d& p_shape, double r_m) {
  const double reach_m = sphere.radius_m + r_m;
  return p_shape.squaredNorm() < reach_m * reach_m;
}

bool is_near(const Shape& shape, const Eigen::Vector3d& p_shape, double r_m) {
  return signed_distance_m(shape, p_shape) < r_m;
}

}  // namespace

SphereStates::SphereStates(std::shared_ptr<const RobotModel> robot, const Scene& scene,
                           double margin_m)
    : robot_(std::move(robot)), margin_m_(margin_m) {
  for (const SceneObject& object : scene.objects()) {
    place(object.shape, object.T_world_object(0.0));
  }
  const RobotDescription& description = robot_->description();
  const std::vector<CollisionSphere>& spheres = description.spheres;
  for (const auto& [link, other] : description.self_collision_pairs) {
    for (std::size_t a = 0; a < spheres.size(); ++a) {
      if (spheres[a].link != link) continue;
      for (std::size_t b = 0; b < spheres.size(); ++b) {
        if (spheres[b].link != other) continue;
        pairs_.push_back({a, b, spheres[a].radius_m + spheres[b].radius_m});
      }
    }
  }
  centres_m_.resize(spheres.size());
}

void SphereStates::place(const Shape& shape, const Transform& T_world_shape) {
  if (const auto* box = std::get_if<Box>(&shape)) {
    boxes_.push_back(placed(*box, T_world_shape));
  } else if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    cylinders_.push_back(placed(*cylinder, T_world_shape));
  } else if (const auto* ball = std::get_if<Sphere>(&shape)) {
    balls_.push_back(placed(*ball, T_world_shape));
  } else {
    others_.push_back(placed(shape, T_world_shape));
  }
}

bool SphereStates::is_free(std::span<const double> q) {
  robot_->sphere_centres(q, centres_m_, scratch_);
  return is_clear_of_shapes() && is_clear_of_itself();
}

bool SphereStates::is_clear_of_shapes() const {
  const std::vector<CollisionSphere>& spheres = robot_->description().spheres;
  for (std::size_t s = 0; s < spheres.size(); ++s) {
    const double r_m = spheres[s].radius_m + margin_m_;
    const auto is_near_one = [&](const auto& one) {
      const double reach_m = one.bound_m + r_m;
      return (centres_m_[s] - one.centre_m).squaredNorm() < reach_m * reach_m &&
             is_near(one.shape, one.T_shape_world * centres_m_[s], r_m);
    };
    if (std::ranges::any_of(boxes_, is_near_one) || std::ranges::any_of(cylinders_, is_near_one) ||
        std::ranges::any_of(balls_, is_near_one) || std::ranges::any_of(others_, is_near_one)) {
      return false;
    }
  }
  return true;
}

bool SphereStates::is_clear_of_itself() const {
  return std::ranges::none_of(pairs_, [&](const Pair& pair) {
    return (centres_m_[pair.first] - centres_m_[pair.second]).squaredNorm() <
           pair.reach_m * pair.reach_m;
  });
}

}  // namespace sidestep::plain_driver
