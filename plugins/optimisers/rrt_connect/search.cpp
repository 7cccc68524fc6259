#include "search.hpp"

#include <algorithm>
#include <cmath>

#include <sidestep/core/index.hpp>

namespace sidestep::rrt_connect {
namespace {

constexpr double kDomainChange = 1e-4;
/// In a round, from everywhere; most of them may be outside the domains.
constexpr int kWideDraws = 128;
constexpr int kMostDraws = kWideDraws + 64;

bool holds(unsigned bits, std::size_t number) { return (bits >> number & 1u) != 0; }

}  // namespace

std::size_t Search::Side::add(std::span<const double> u, std::size_t parent) {
  domain_m.push_back(kInfinity);
  return tree.add(u, parent);
}

Search::Search(const joint_paths::JointSpace& space, std::span<const double> start,
               joint_paths::Checker& checker, const SearchSettings& settings, std::uint64_t seed,
               const Deadline& deadline)
    : space_(space),
      checker_(checker),
      settings_(settings),
      deadline_(deadline),
      dof_(space.dof()),
      start_(start.begin(), start.end()),
      random_(seed),
      sides_(2, Side{Tree(dof_)}),
      sample_(dof_),
      drawn_(kLanes * dof_),
      drawn_from_(kLanes),
      steps_(kLanes * dof_),
      q_(kLanes * dof_),
      q_to_(dof_) {
  space.from_joints(start, sample_);
  (void)sides_[0].add(sample_, Tree::kNone);
  for (const Eigen::VectorXd& goal : space.goals()) {
    space.from_joints(as_span(goal), sample_);
    (void)sides_[1].add(sample_, Tree::kNone);
  }
}

std::optional<std::vector<double>> Search::grow() {
  const std::size_t sizes[] = {sides_[0].tree.size(), sides_[1].tree.size()};
  turn_ = sizes[0] == sizes[1] ? 1 - turn_ : sizes[0] < sizes[1] ? 0 : 1;
  Side& side = sides_[turn_];
  const std::size_t count = draw(side);
  const unsigned blocked = find_blocked(std::span(drawn_).first(count * dof_));
  for (std::size_t i = 0; i < count; ++i) {
    const std::span<const double> u = std::span(drawn_).subspan(i * dof_, dof_);
    const auto added = extend(side, drawn_from_[i], u, holds(blocked, i));
    if (!added) continue;
    if (const auto met = connect(sides_[1 - turn_], u)) {
      return turn_ == 0 ? path(*added, *met) : path(*met, *added);
    }
  }
  return std::nullopt;
}

/// Fills drawn_ and drawn_from_; how many.
std::size_t Search::draw(const Side& side) {
  std::size_t count = 0;
  for (int draws = 0; count < kLanes && draws < kMostDraws; ++draws) {
    ++samples_;
    if (draws < kWideDraws) {
      sample_space();
    } else {
      sample_domain(side);
    }
    const Tree::Found near = side.tree.nearest(sample_);
    if (near.distance > side.domain_m[near.number] || near.distance == 0.0) continue;
    way_.look(space_.steering(), side.tree.point(near.number), sample_);
    way_.at(std::min(1.0, settings_.range_m / way_.length()),
            std::span(drawn_).subspan(count * dof_, dof_));
    drawn_from_[count++] = near.number;
  }
  return count;
}

void Search::sample_space() {
  for (std::size_t j = 0; j < dof_; ++j) {
    sample_[j] = space_.lower(j) + random_.unit() * (space_.upper(j) - space_.lower(j));
  }
}

/// From the domain of one of the tree's configurations: where all of them are hemmed in, hardly a
/// sample of the whole space is in any.
void Search::sample_domain(const Side& side) {
  const auto number =
      static_cast<std::size_t>(random_.unit() * static_cast<double>(side.tree.size()));
  const double reach_m = std::min(side.domain_m[number], settings_.domain * settings_.range_m) /
                         std::sqrt(static_cast<double>(dof_));
  for (std::size_t j = 0; j < dof_; ++j) {
    sample_[j] = std::clamp(side.tree.point(number)[j] + (2.0 * random_.unit() - 1.0) * reach_m,
                            space_.lower(j), space_.upper(j));
  }
}

/// Grows a tree straight towards u in steps, as far as that is clear; the number of u in it.
std::optional<std::size_t> Search::connect(Side& side, std::span<const double> u) {
  std::size_t last = side.tree.nearest(u).number;
  way_.look(space_.steering(), side.tree.point(last), u);
  const auto steps =
      static_cast<std::size_t>(std::max(1.0, std::ceil(way_.length() / settings_.range_m)));
  for (std::size_t first = 1; first <= steps; first += kLanes) {
    const std::size_t count = std::min(kLanes, steps + 1 - first);
    for (std::size_t i = 0; i < count; ++i) {
      way_.at(static_cast<double>(first + i) / static_cast<double>(steps),
              std::span(steps_).subspan(i * dof_, dof_));
    }
    const unsigned blocked = find_blocked(std::span(steps_).first(count * dof_));
    for (std::size_t i = 0; i < count; ++i) {
      const auto added =
          extend(side, last, std::span(steps_).subspan(i * dof_, dof_), holds(blocked, i));
      if (!added) return std::nullopt;
      last = *added;
    }
  }
  return last;
}

/// The number of u, if the motion to it is clear.
std::optional<std::size_t> Search::extend(Side& side, std::size_t from, std::span<const double> u,
                                          bool is_blocked) {
  if (!is_blocked) ++looks_;
  edge_.look(space_.steering(), side.tree.point(from), u);
  if (is_blocked || deadline_.expired() || !is_clear(edge_)) {
    double& domain_m = side.domain_m[from];
    domain_m = std::max(settings_.range_m, std::min(domain_m * (1.0 - kDomainChange),
                                                    settings_.domain * settings_.range_m));
    return std::nullopt;
  }
  side.domain_m[from] *= 1.0 + kDomainChange;
  for (std::size_t i = dof_; i < edge_.vertices().size(); i += dof_) {
    from = side.add(edge_.vertices().subspan(i, dof_), from);
  }
  return from;
}

bool Search::is_clear(const joint_paths::Way& way) {
  const std::span<double> q_from = std::span(q_).first(dof_);
  space_.to_joints(way.vertices().first(dof_), q_from);
  for (std::size_t i = dof_; i < way.vertices().size(); i += dof_) {
    space_.to_joints(way.vertices().subspan(i, dof_), q_to_);
    if (!checker_.is_clear(q_from, q_to_, settings_.resolution_m)) return false;
    std::ranges::copy(q_to_, q_from.begin());
  }
  return true;
}

unsigned Search::find_blocked(std::span<const double> u) {
  for (std::size_t i = 0; i < u.size(); i += dof_) {
    space_.to_joints(u.subspan(i, dof_), std::span(q_).subspan(i, dof_));
  }
  if (u.empty()) return 0;
  ++looks_;
  return checker_.find_blocked(std::span<const double>(q_).first(u.size()));
}

std::vector<double> Search::path(std::size_t from_start, std::size_t from_goal) const {
  std::vector<std::span<const double>> vertices;
  std::size_t goal = from_goal;
  for (std::size_t at = from_start; at != Tree::kNone; at = sides_[0].tree.parent(at)) {
    vertices.push_back(sides_[0].tree.point(at));
  }
  std::ranges::reverse(vertices);
  for (std::size_t at = sides_[1].tree.parent(from_goal); at != Tree::kNone;
       at = sides_[1].tree.parent(at)) {
    vertices.push_back(sides_[1].tree.point(at));
    goal = at;
  }
  std::vector<double> path(vertices.size() * dof_);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    space_.to_joints(vertices[i], std::span(path).subspan(i * dof_, dof_));
  }
  // Exactly, not up to the rounding of the space.
  std::ranges::copy(start_, path.begin());
  std::ranges::copy(as_span(space_.goals()[goal]), path.end() - static_cast<std::ptrdiff_t>(dof_));
  return path;
}

}  // namespace sidestep::rrt_connect
