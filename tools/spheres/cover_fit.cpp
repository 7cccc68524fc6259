#include "cover_fit.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "cluster_fit.hpp"
#include "shape_covers.hpp"

namespace sidestep {
namespace {

/// Boxes at the surface, as a share of the protrusion that is aimed at.
constexpr double kFineShare = 0.2;
/// Spheres of one shape, where there is a number to be shared out.
constexpr int kMostSpheresOnShape = 48;
/// Of a body, to find out what is held twice.
constexpr double kFineOfRadius = 0.05;
constexpr std::size_t kMostCells = 60'000;

double volume_m3(const RigidBody& body, int link) {
  double sum = 0.0;
  for (const BodyPart& part : body.parts) {
    if (part.link == link) sum += 8.0 * bounds_of(part.shape).half_m.prod();
  }
  return sum;
}

/// The links with shapes, the largest first: its spheres may hold small ones beside it.
std::vector<int> links_by_size(const RigidBody& body) {
  std::vector<int> links;
  for (const BodyLink& one : body.links) {
    if (volume_m3(body, one.link) > 0.0) links.push_back(one.link);
  }
  std::ranges::stable_sort(links, std::ranges::greater{},
                           [&](int link) { return volume_m3(body, link); });
  return links;
}

void append(std::vector<CollisionSphere>& all, const std::vector<CollisionSphere>& more) {
  all.insert(all.end(), more.begin(), more.end());
}

/// A link that is to be fitted.
struct Task {
  const RigidBody* body;
  int link;
  Held held;
};

/// Of the robot, or of the one link that is named.
std::vector<Task> tasks(const std::vector<RigidBody>& bodies,
                        const std::vector<CollisionSphere>& kept, const std::optional<int>& link) {
  std::vector<Task> all;
  for (const RigidBody& body : bodies) {
    std::vector<int> done;
    for (const int one : links_by_size(body)) {
      if (link && one != *link) continue;
      all.push_back({&body, one, {spheres_of(body, kept), done}});
      done.push_back(one);
    }
  }
  return all;
}

std::vector<CollisionSphere> fit_to_protrusion(std::vector<Task> links,
                                               std::vector<CollisionSphere> spheres,
                                               double protrusion_m, const std::stop_token& stop) {
  for (Task& task : links) {
    task.held.spheres = spheres_of(*task.body, spheres);
    ClusterFit fit(*task.body, task.link, task.held, {protrusion_m, kFineShare * protrusion_m});
    fit.reach_protrusion(FitGoal::kMostSpheresOnLink, stop);
    append(spheres, fit.result());
  }
  return spheres;
}

/// A shape, and which of its covers is taken.
struct Choice {
  std::vector<ShapeCover> covers;
  std::size_t taken = 0;

  [[nodiscard]] int spheres() const { return static_cast<int>(covers[taken].spheres.size()); }
  struct Step {
    std::size_t to = 0;
    int spheres = 0;       ///< More than now.
    double gain_m3 = 0.0;  ///< Less excess for each of these.
  };
  /// The one that gains the most a sphere, with at most so many more.
  [[nodiscard]] Step best_step(int most_more) const {
    Step best;
    for (std::size_t to = taken + 1; to < covers.size(); ++to) {
      const int more = static_cast<int>(covers[to].spheres.size()) - spheres();
      if (more > most_more) break;
      const double gain = (covers[taken].excess_m3 - covers[to].excess_m3) / more;
      if (gain > best.gain_m3) best = {to, more, gain};
    }
    return best;
  }
};

/// Shares the spheres out among the shapes: each time to the one where they save the most.
void share_out(std::vector<Choice>& choices, int most_spheres) {
  int left = most_spheres;
  for (const Choice& choice : choices) left -= choice.spheres();
  while (left > 0) {
    Choice* chosen = nullptr;
    Choice::Step step;
    for (Choice& choice : choices) {
      const Choice::Step one = choice.best_step(left);
      if (one.gain_m3 <= step.gain_m3) continue;
      step = one;
      chosen = &choice;
    }
    if (chosen == nullptr) return;
    chosen->taken = step.to;
    left -= step.spheres;
  }
}

/// Removes spheres of the links that others of the body make superfluous, the smallest first.
void drop_held(const RigidBody& body, const std::vector<int>& links,
               std::vector<BodySphere>& spheres) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const BodySphere& sphere : spheres) smallest = std::min(smallest, sphere.radius_m);
  std::vector<Cell> cells;
  for (const int link : links) {
    const auto more = link_cells(body, link, {}, kFineOfRadius * smallest, kMostCells);
    cells.insert(cells.end(), more.begin(), more.end());
  }
  const auto holds = [&](const BodySphere& sphere, const Cell& cell) {
    const BodyPart& part = body.parts[static_cast<std::size_t>(cell.part)];
    return farthest_m(cell, part.T_shape_body * sphere.p_body) <= sphere.radius_m;
  };
  std::vector<int> holders(cells.size(), 0);
  for (const BodySphere& sphere : spheres) {
    for (std::size_t i = 0; i < cells.size(); ++i) holders[i] += holds(sphere, cells[i]) ? 1 : 0;
  }
  std::ranges::stable_sort(spheres, {}, &BodySphere::radius_m);
  const auto is_near = [&](const BodySphere& sphere, const Cell& cell) {
    const BodyPart& part = body.parts[static_cast<std::size_t>(cell.part)];
    return (part.T_shape_body * sphere.p_body - cell.p_shape).norm() <=
           sphere.radius_m + cell.half_m.norm();
  };
  std::erase_if(spheres, [&](const BodySphere& sphere) {
    if (std::ranges::count(links, sphere.link) == 0) return false;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const bool is_needed =
          is_near(sphere, cells[i]) && holders[i] - (holds(sphere, cells[i]) ? 1 : 0) <= 0;
      if (is_needed) return false;
    }
    for (std::size_t i = 0; i < cells.size(); ++i) holders[i] -= holds(sphere, cells[i]) ? 1 : 0;
    return true;
  });
}

/// In the frames of their links, rounded, and so much larger that they hold what they held.
std::vector<CollisionSphere> in_links(const RigidBody& body,
                                      const std::vector<BodySphere>& spheres) {
  std::vector<CollisionSphere> out;
  for (const BodySphere& sphere : spheres) {
    const Eigen::Vector3d exact = body.find(sphere.link)->T_body_link.inverse() * sphere.p_body;
    const Eigen::Vector3d centre = to_grain(exact);
    out.push_back({sphere.link, centre, up_to_grain(sphere.radius_m + (centre - exact).norm())});
  }
  return out;
}

std::vector<CollisionSphere> fit_to_count(const std::vector<RigidBody>& bodies,
                                          const std::vector<CollisionSphere>& kept,
                                          const FitGoal& goal, const std::stop_token& stop) {
  std::vector<Choice> choices;
  for (const Task& task : tasks(bodies, kept, goal.link)) {
    for (const BodyPart& part : task.body->parts) {
      if (part.link != task.link) continue;
      Choice choice{shape_covers(*task.body, part, kMostSpheresOnShape, stop)};
      if (!choice.covers.empty()) choices.push_back(std::move(choice));
    }
  }
  share_out(choices, *goal.most_spheres);
  std::vector<CollisionSphere> spheres = kept;
  for (const RigidBody& body : bodies) {
    std::vector<int> links = links_by_size(body);
    if (goal.link) std::erase_if(links, [&](int link) { return link != *goal.link; });
    std::vector<BodySphere> chosen = spheres_of(body, kept);
    for (const Choice& choice : choices) {
      for (const BodySphere& sphere : choice.covers[choice.taken].spheres) {
        if (std::ranges::count(links, sphere.link) > 0) chosen.push_back(sphere);
      }
    }
    if (chosen.empty() || links.empty()) continue;
    drop_held(body, links, chosen);
    std::erase_if(chosen,
                  [&](const BodySphere& one) { return std::ranges::count(links, one.link) == 0; });
    append(spheres, in_links(body, chosen));
  }
  return spheres;
}

}  // namespace

std::vector<CollisionSphere> fit_cover(const std::vector<RigidBody>& bodies,
                                       const std::vector<CollisionSphere>& now, const FitGoal& goal,
                                       const std::stop_token& stop) {
  std::vector<CollisionSphere> kept;
  if (goal.link) {
    std::ranges::copy_if(now, std::back_inserter(kept),
                         [&](const CollisionSphere& sphere) { return sphere.link != *goal.link; });
  }
  std::vector<CollisionSphere> spheres =
      goal.most_spheres
          ? fit_to_count(bodies, kept, goal, stop)
          : fit_to_protrusion(tasks(bodies, kept, goal.link), kept, goal.protrusion_m, stop);
  std::ranges::stable_sort(spheres, {}, &CollisionSphere::link);
  return spheres;
}

}  // namespace sidestep
