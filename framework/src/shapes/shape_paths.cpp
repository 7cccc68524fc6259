#include "shape_paths.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// Bounds on motion are those of steps in which nothing moves farther: longer ones are halved.
constexpr double kLongestStep_m = 0.05;

constexpr int kBounds = -1;  ///< The item; then come shapes, then pairs.

}  // namespace

ShapePaths::ShapePaths(std::shared_ptr<const RobotModel> robot, ShapeWorld world)
    : robot_(std::move(robot)),
      world_(std::move(world)),
      motion_(*robot_),
      collider_(robot_->description(), world_.obstacles, world_.allowed),
      pose_(collider_.make_pose()),
      poses_(robot_->description().links.size()),
      q_(robot_->description().joints.size()),
      ways_(q_.size()),
      link_ways_m_(poses_.size()),
      centres_m_(robot_->description().spheres.size()) {
  const int first = world_.bounds_m ? kBounds : kBounds + 1;
  std::vector<Item> items(idx(collider_.shape_count() + collider_.pair_count() - first));
  std::iota(items.begin(), items.end(), first);
  all_ = std::make_shared<const std::vector<Item>>(std::move(items));
}

void ShapePaths::place(std::span<const double> q) {
  robot_->link_poses(q, poses_, scratch_);
  collider_.place(*pose_, poses_, world_.obstacles.scene_time_s);
  if (world_.bounds_m) robot_->sphere_centres(q, centres_m_, scratch_);
  std::ranges::fill(link_ways_m_, -1.0);
}

bool ShapePaths::is_clear(std::span<const double> q) {
  place(q);
  std::ranges::fill(ways_, 0.0);
  const auto open = look_at(*all_);
  return open && open->empty();
}

bool ShapePaths::is_clear(std::span<const double> q_from, std::span<const double> q_to,
                          double resolution_m) {
  std::vector<Part> parts{{0.5, all_}};
  std::vector<Part> next;
  for (double half = 0.5; !parts.empty(); half *= 0.5, next.clear()) {
    for (const Part& part : parts) {
      for (std::size_t j = 0; j < q_.size(); ++j) {
        q_[j] = q_from[j] + part.middle * (q_to[j] - q_from[j]);
        ways_[j] = half * std::abs(q_to[j] - q_from[j]);
      }
      place(q_);
      auto open = look_at(*part.items);
      if (!open) return false;
      if (open->empty()) continue;
      if (2.0 * robot_way_m() <= resolution_m) return false;
      const auto items = std::make_shared<const std::vector<Item>>(std::move(*open));
      next.push_back({part.middle - 0.5 * half, items});
      next.push_back({part.middle + 0.5 * half, items});
    }
    std::swap(parts, next);
  }
  return true;
}

std::optional<std::vector<ShapePaths::Item>> ShapePaths::look_at(const std::vector<Item>& items) {
  std::vector<Item> open;
  for (const Item item : items) {
    const Shown shown = look_at(item);
    if (shown == Shown::kBlocked) {
      look_at_first(item);
      return std::nullopt;
    }
    if (shown == Shown::kOpen) open.push_back(item);
  }
  return open;
}

/// From now on. What blocks one motion is likely to block the next.
void ShapePaths::look_at_first(Item item) {
  if (all_->front() == item) return;
  std::vector<Item> items = *all_;
  const auto found = std::ranges::find(items, item);
  std::rotate(items.begin(), found, found + 1);
  all_ = std::make_shared<const std::vector<Item>>(std::move(items));
}

ShapePaths::Shown ShapePaths::look_at(Item item) {
  if (item == kBounds) return look_at_bounds();
  const int pair = item - collider_.shape_count();
  const bool is_pair = pair >= 0;
  const double margin_m = is_pair ? world_.self_margin_m : world_.margin_m;
  const double way_m =
      is_pair ? pair_way_m(pair) : link_way_m(robot_->description().shapes[idx(item)].link);
  const bool is_short = way_m <= kLongestStep_m;
  const double wanted_m = margin_m + (is_short ? way_m : 0.0);
  const double gap_m = is_pair ? collider_.gap_between_pair_m(pair, *pose_, wanted_m)
                               : collider_.gap_to_obstacles_m(item, *pose_, wanted_m);
  if (gap_m < margin_m || (gap_m <= 0.0 && wanted_m > 0.0)) return Shown::kBlocked;
  return is_short && gap_m >= wanted_m ? Shown::kClear : Shown::kOpen;
}

/// Of whatever is looked at.
double ShapePaths::robot_way_m() const {
  const double shapes_m = motion_.robot_way_m(poses_, ways_, kLongestStep_m);
  if (!world_.bounds_m) return shapes_m;
  return std::max(shapes_m, motion_.centres_way_m(poses_, ways_, kLongestStep_m));
}

double ShapePaths::link_way_m(int link) {
  double& way_m = link_ways_m_[idx(link)];
  if (way_m < 0.0) way_m = motion_.link_way_m(link, poses_, ways_, kLongestStep_m);
  return way_m;
}

double ShapePaths::pair_way_m(int pair) const {
  const auto [a, b] = collider_.pair_links(pair);
  return motion_.link_way_m(a, poses_, ways_, kLongestStep_m, b) +
         motion_.link_way_m(b, poses_, ways_, kLongestStep_m, a);
}

/// Distance of the centres from leaving the bounds; negative outside.
double ShapePaths::inside_m() const {
  double least_m = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& centre : centres_m_) {
    least_m = std::min({least_m, (centre - world_.bounds_m->min()).minCoeff(),
                        (world_.bounds_m->max() - centre).minCoeff()});
  }
  return least_m;
}

ShapePaths::Shown ShapePaths::look_at_bounds() {
  const double clearance_m = inside_m();
  if (clearance_m < 0.0) return Shown::kBlocked;
  const double way_m = robot_way_m();
  return way_m <= std::min(clearance_m, kLongestStep_m) ? Shown::kClear : Shown::kOpen;
}

std::optional<Violation> ShapePaths::violation(std::span<const double> q) {
  const RobotDescription& robot = robot_->description();
  place(q);
  Violation worst;
  worst.amount = -1.0;
  const auto hear = [&](Violation::Kind kind, int link, std::string other, double amount_m) {
    if (amount_m <= 0.0 || amount_m <= worst.amount) return;
    worst = {kind, robot.links[idx(link)].name, std::move(other), 0.0, amount_m};
  };
  for (int s = 0; s < collider_.shape_count(); ++s) {
    auto found = collider_.to_obstacles(s, *pose_, world_.margin_m);
    hear(Violation::Kind::kCollision, robot.shapes[idx(s)].link, std::move(found.other),
         world_.margin_m - found.clearance_m);
  }
  if (worst.amount < 0.0) {
    for (int p = 0; p < collider_.pair_count(); ++p) {
      const auto [a, b] = collider_.pair_links(p);
      hear(Violation::Kind::kSelfCollision, b, robot.links[idx(a)].name,
           world_.self_margin_m - collider_.between_pair(p, *pose_, world_.self_margin_m));
    }
  }
  if (worst.amount < 0.0 && world_.bounds_m) {
    for (std::size_t s = 0; s < centres_m_.size(); ++s) {
      const double outside_m = world_.bounds_m->exteriorDistance(centres_m_[s]);
      hear(Violation::Kind::kCollision, robot.spheres[s].link, "the space outside the map",
           outside_m);
    }
  }
  if (worst.amount < 0.0) return std::nullopt;
  return worst;
}

}  // namespace sidestep
