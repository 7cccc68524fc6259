#include "swept_contacts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace sidestep {
namespace {

constexpr std::size_t kMostLooks = 64;  ///< At points of one axis.

struct Look {
  double fraction;
  double distance_m;
};

/// What the distance between two looks cannot be less than, a way of length_m apart.
double least_between(const Look& a, const Look& b, double length_m) {
  const double apart_m = (b.fraction - a.fraction) * length_m;
  return std::min({a.distance_m, b.distance_m, 0.5 * (a.distance_m + b.distance_m - apart_m)});
}

}  // namespace

SweptContacts::SweptContacts(const Problem& problem)
    : problem_(&problem),
      floor_(problem.space, problem.robot->description()),
      spheres_(problem.robot->description().spheres.size()) {
  for (const CollisionSphere& sphere : problem.robot->description().spheres) {
    radius_m_.push_back(sphere.radius_m);
  }
}

const std::vector<SweptContact>& SweptContacts::find(const WaypointStates& states, double reach_m) {
  contacts_.clear();
  if (spheres_ == 0 || (!problem_->field && !problem_->space.floor)) return contacts_;
  look(states);
  for (int s = 0; s + 1 < states.states(); ++s) {
    for (std::size_t sphere = 0; sphere < spheres_; ++sphere) {
      if (problem_->field) sweep(s, sphere, reach_m);
      if (problem_->space.floor) drop(s, sphere, reach_m);
    }
  }
  return contacts_;
}

void SweptContacts::look(const WaypointStates& states) {
  const StateBatch all = states.everywhere();
  const std::size_t points = spheres_ * static_cast<std::size_t>(all.count);
  centres_m_.resize(points);
  distances_m_.assign(points, std::numeric_limits<double>::infinity());
  statuses_.resize(points);
  problem_->robot->sphere_centres(all.q, centres_m_, scratch_);
  if (problem_->field) {
    query_with_policy(*problem_->field, problem_->space, centres_m_, distances_m_, {}, statuses_);
  }
}

double SweptContacts::clearance_m(int state, std::size_t sphere) const {
  const std::size_t point = static_cast<std::size_t>(state) * spheres_ + sphere;
  return std::min(distances_m_[point] - radius_m_[sphere], floor_(sphere, centres_m_[point]));
}

/// Of a curve through equally spaced points, an eighth of its second difference is how far it is
/// from the chord half way.
double SweptContacts::departure_m(std::size_t point, std::size_t next) const {
  double bend_m = 0.0;
  for (const std::size_t p : {point, next}) {
    if (p < spheres_ || p + spheres_ >= centres_m_.size()) continue;
    const Eigen::Vector3d bend =
        centres_m_[p - spheres_] - 2.0 * centres_m_[p] + centres_m_[p + spheres_];
    bend_m = std::max(bend_m, bend.norm());
  }
  return bend_m / 8.0;
}

void SweptContacts::sweep(int state, std::size_t sphere, double reach_m) {
  const std::size_t from = static_cast<std::size_t>(state) * spheres_ + sphere;
  const std::size_t to = from + spheres_;
  const double length_m = (centres_m_[to] - centres_m_[from]).norm();
  const double bend_m = departure_m(from, to);
  const double lost_m = radius_m_[sphere] + bend_m;
  std::array<Look, kMostLooks> looks{{{0.0, distances_m_[from]}, {1.0, distances_m_[to]}}};
  std::size_t count = 2;
  const auto point_at = [&](double fraction) {
    return Eigen::Vector3d(centres_m_[from] + fraction * (centres_m_[to] - centres_m_[from]));
  };
  double least_m = 0.0;
  for (;;) {
    std::size_t worst = 0;
    least_m = std::numeric_limits<double>::infinity();
    double seen_m = least_m;
    for (std::size_t i = 0; i < count; ++i) {
      seen_m = std::min(seen_m, looks[i].distance_m);
      if (i + 1 == count) break;
      const double between_m = least_between(looks[i], looks[i + 1], length_m);
      if (between_m >= least_m) continue;
      least_m = between_m;
      worst = i;
    }
    if (!(least_m - lost_m < reach_m)) return;
    if (seen_m - least_m <= kSearch_m || count == kMostLooks) break;
    const double fraction = 0.5 * (looks[worst].fraction + looks[worst + 1].fraction);
    const Eigen::Vector3d point = point_at(fraction);
    double distance_m = 0.0;
    FieldStatus status{};
    query_with_policy(*problem_->field, problem_->space, {&point, 1}, {&distance_m, 1}, {},
                      {&status, 1});
    std::copy_backward(looks.begin() + static_cast<std::ptrdiff_t>(worst) + 1,
                       looks.begin() + static_cast<std::ptrdiff_t>(count),
                       looks.begin() + static_cast<std::ptrdiff_t>(count) + 1);
    looks[worst + 1] = {fraction, distance_m};
    ++count;
  }
  const Look& nearest =
      *std::min_element(looks.begin(), looks.begin() + static_cast<std::ptrdiff_t>(count),
                        [](const Look& a, const Look& b) { return a.distance_m < b.distance_m; });
  const Eigen::Vector3d point = point_at(nearest.fraction);
  SweptContact contact{
      state, sphere, nearest.fraction, least_m - lost_m, nearest.distance_m - least_m + bend_m, {}};
  double distance_m = 0.0;
  FieldStatus status{};
  query_with_policy(*problem_->field, problem_->space, {&point, 1}, {&distance_m, 1},
                    {&contact.normal, 1}, {&status, 1});
  contacts_.push_back(contact);
}

void SweptContacts::drop(int state, std::size_t sphere, double reach_m) {
  const std::size_t from = static_cast<std::size_t>(state) * spheres_ + sphere;
  const std::size_t to = from + spheres_;
  const double at_from_m = floor_(sphere, centres_m_[from]);
  const double at_to_m = floor_(sphere, centres_m_[to]);
  const double bend_m = departure_m(from, to);
  const double least_m = std::min(at_from_m, at_to_m) - bend_m;
  if (!(least_m < reach_m)) return;
  contacts_.push_back(
      {state, sphere, at_to_m < at_from_m ? 1.0 : 0.0, least_m, bend_m, Eigen::Vector3d::UnitZ()});
}

}  // namespace sidestep
