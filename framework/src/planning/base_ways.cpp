#include <sidestep/planning/base_ways.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <queue>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/initial_guess.hpp>

namespace sidestep {
namespace {

constexpr double kUnreached_m = std::numeric_limits<double>::infinity();
constexpr double kLeastCell_m = 0.05;
constexpr double kMostCells = 200.0;  ///< Along the longer side of the field.
constexpr double kFarther = 2.0;      ///< Than the start: nothing beyond is looked at.
/// A step where the robot touches something costs as much as so many in the open.
constexpr double kTightness = 4.0;
constexpr double kOpen_m = 0.3;  ///< Clearance from which on more is worth nothing.
/// Within so many cells of a position nobody looked at, or that is too near to obstacles, one is
/// looked for that has a way.
constexpr int kBeside = 4;
constexpr double kFullTurn_rad = 2.0 * std::numbers::pi;
constexpr int kTurns = 16;          ///< Headings that are looked at where it turns on the spot,
constexpr int kMostCellsBack = 30;  ///< and cells that it goes back or ahead for that.
constexpr double kRounding_m = 1e-9;
constexpr double kChord_m = 0.3;  ///< Half of a chord that a heading is taken from.

double price(double clearance_m) {
  const double lacks = std::clamp((kOpen_m - clearance_m) / kOpen_m, 0.0, 1.0);
  return 1.0 + (kTightness - 1.0) * lacks;
}

/// Where a base goes: x, y and, where it rolls, its heading; and what it has gone by then, in m.
class Places {
 public:
  void add(const Eigen::Vector3d& place, double step_m) {
    places_.push_back(place);
    gone_m_.push_back(length_m() + step_m);
  }
  [[nodiscard]] std::size_t size() const noexcept { return places_.size(); }
  [[nodiscard]] const Eigen::Vector3d& operator[](std::size_t i) const { return places_[i]; }
  [[nodiscard]] double length_m() const noexcept { return gone_m_.empty() ? 0.0 : gone_m_.back(); }
  [[nodiscard]] double gone_m(std::size_t i) const { return gone_m_[i]; }

  /// Between them, evenly; beyond its ends, there.
  [[nodiscard]] Eigen::Vector3d at(double at_m) const {
    const auto after = std::ranges::upper_bound(gone_m_, at_m);
    const auto to = static_cast<std::size_t>(after - gone_m_.begin());
    if (to == 0) return places_.front();
    if (to == places_.size()) return places_.back();
    const double share = (at_m - gone_m_[to - 1]) / (gone_m_[to] - gone_m_[to - 1]);
    return places_[to - 1] + share * (places_[to] - places_[to - 1]);
  }

 private:
  std::vector<Eigen::Vector3d> places_;
  std::vector<double> gone_m_;
};

Places along(std::span<const Eigen::Vector2d> points_m) {
  Places way;
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    const double step_m = i > 0 ? (points_m[i] - points_m[i - 1]).norm() : 0.0;
    way.add({points_m[i].x(), points_m[i].y(), 0.0}, step_m);
  }
  return way;
}

/// A rolling base's way from start to goal, whose positions from where it turns first are `way`.
/// It drives ahead, or back where the turns that this saves take longer than the way: its sensors
/// look ahead.
Places rolled(const Places& way, const Problem& problem, const RollingBase& base) {
  const std::vector<Joint>& joints = problem.robot->description().joints;
  const double radius_m = joints[idx(base.x)].max_velocity / joints[idx(base.yaw)].max_velocity;
  const auto place_of = [&](const Eigen::VectorXd& q) {
    return Eigen::Vector3d(q[base.x], q[base.y], q[base.yaw]);
  };
  const Eigen::Vector3d start = place_of(problem.start.q), goal = place_of(problem.goal.q);
  const auto driving = [&](double turned) {
    Places all;
    all.add(start, 0.0);
    Eigen::Vector3d last{way[0].x(), way[0].y(), start.z()};
    all.add(last, (last - start).norm());
    const auto add = [&](const Eigen::Vector3d& place) {
      const double step_m = (place - last).head<2>().norm();
      all.add(place, std::max(step_m, radius_m * std::abs(place.z() - last.z())));
      last = place;
    };
    for (std::size_t i = 0; i < way.size(); ++i) {
      // By chords: neighbours on the grid lie in eight directions only.
      const double at_m = way.gone_m(i);
      const Eigen::Vector3d chord_m = way.at(at_m + kChord_m) - way.at(at_m - kChord_m);
      const double heading = std::atan2(chord_m.y(), chord_m.x()) + turned;
      const double turn = std::remainder(heading - last.z(), kFullTurn_rad);
      add({way[i].x(), way[i].y(), last.z() + turn});
    }
    add(goal);
    return all;
  };
  const Places ahead = driving(0.0), back = driving(std::numbers::pi);
  return back.length_m() + way.length_m() < ahead.length_m() ? back : ahead;
}

}  // namespace

/// Dijkstra's algorithm, and the clearance of the positions that it comes to.
class BaseWays::Search {
 public:
  Search(const Problem& problem, BaseWays& ways)
      : problem_(problem),
        ways_(ways),
        start_m_(ways.at(as_span(problem.start.q))),
        clearances_m_(ways.positions_.size(), std::numeric_limits<double>::quiet_NaN()) {}

  void run(const Deadline& deadline) {
    double margin_m =
        std::min(problem_.collision_margin_m, clearances_of(problem_.start.q).front());
    if (const auto& rolling = problem_.robot->description().rolling) {
      if (const auto way_m = way_to_turn_m(*rolling, margin_m)) {
        ways_.to_turn_m_ = *way_m;
        start_m_ += *way_m;
        margin_m = problem_.collision_margin_m;
      }
    }
    for (const double short_m : {0.0, 0.5 * ways_.cell_m_}) {
      spread(margin_m - short_m, deadline);
      if (!ways_.empty()) return;
    }
  }

 private:
  void spread(double margin_m, const Deadline& deadline) {
    std::ranges::fill(ways_.positions_, Position{kUnreached_m});
    std::vector<bool> is_settled(ways_.positions_.size());
    using Entry = std::pair<double, std::int32_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
    const std::int32_t goal = ways_.nearest(ways_.goal_m_);
    ways_.positions_[idx(goal)].cost_m = 0.0;
    clearances_m_[idx(goal)] = kUnreached_m;
    open.emplace(0.0, goal);
    double most_m = kUnreached_m;
    std::vector<std::int32_t> around;
    while (!open.empty() && open.top().first < most_m) {
      if (deadline.expired()) {
        ways_.first_ = -1;
        return;
      }
      const std::int32_t current = open.top().second;
      open.pop();
      if (is_settled[idx(current)]) continue;
      is_settled[idx(current)] = true;
      const double so_far_m = ways_.positions_[idx(current)].cost_m;
      if (ways_.empty() && (ways_.position_m(current) - start_m_).norm() < ways_.cell_m_) {
        ways_.first_ = current;
        most_m = kFarther * so_far_m;
      }
      find_neighbours(current, around);
      look(around);
      for (const std::int32_t next : around) {
        const double clearance_m = clearances_m_[idx(next)];
        if (is_settled[idx(next)] || !(clearance_m >= margin_m)) continue;
        const double step_m = (ways_.position_m(next) - ways_.position_m(current)).norm();
        const double cost_m = so_far_m + price(clearance_m) * step_m;
        Position& position = ways_.positions_[idx(next)];
        if (!(cost_m < position.cost_m)) continue;
        position = {cost_m, current};
        open.emplace(cost_m, next);
      }
    }
  }

  /// How far a rolling base goes ahead or back to the nearest place where it can turn all around,
  /// no nearer to obstacles on the way there than `least_m`. Nothing where there is none.
  [[nodiscard]] std::optional<Eigen::Vector2d> way_to_turn_m(const RollingBase& base,
                                                             double least_m) {
    const double yaw = problem_.start.q[base.yaw];
    std::array directions{-1.0, 1.0};  // 0: not any farther
    for (int step = 0; step <= kMostCellsBack; ++step) {
      for (double& direction : directions) {
        if (direction == 0.0) continue;
        const Eigen::Vector2d way_m =
            direction * step * ways_.cell_m_ * Eigen::Vector2d(std::cos(yaw), std::sin(yaw));
        q_.clear();
        for (int k = 0; k < kTurns; ++k) {
          Eigen::VectorXd q = problem_.start.q;
          q[base.x] += way_m.x();
          q[base.y] += way_m.y();
          q[base.yaw] += kFullTurn_rad * k / kTurns;
          q_.insert(q_.end(), q.begin(), q.end());
        }
        const std::vector<double>& found_m = clearances_of(q_);
        if (!(found_m.front() >= least_m - kRounding_m)) {
          direction = 0.0;
        } else if (std::ranges::min(found_m) >= problem_.collision_margin_m) {
          return way_m;
        }
      }
    }
    return std::nullopt;
  }

  void find_neighbours(std::int32_t node, std::vector<std::int32_t>& around) const {
    around.clear();
    const int width = 2 * ways_.half_.x() + 1, height = 2 * ways_.half_.y() + 1;
    const int column = node % width, row = node / width;
    for (int y = std::max(0, row - 1); y <= std::min(height - 1, row + 1); ++y) {
      for (int x = std::max(0, column - 1); x <= std::min(width - 1, column + 1); ++x) {
        around.push_back(y * width + x);
      }
    }
  }

  [[nodiscard]] Eigen::VectorXd configuration(std::int32_t node) const {
    const Eigen::Vector2d p_m = ways_.position_m(node);
    const double gone_m = (p_m - start_m_).norm(), left_m = (p_m - ways_.goal_m_).norm();
    const double share = gone_m > 0.0 ? gone_m / (gone_m + left_m) : 0.0;
    Eigen::VectorXd q = problem_.start.q + share * (problem_.goal.q - problem_.start.q);
    q[ways_.x_] = p_m.x();
    q[ways_.y_] = p_m.y();
    return q;
  }

  /// Finds the clearance of those that have none yet.
  void look(std::span<const std::int32_t> nodes) {
    fresh_.clear();
    q_.clear();
    const std::vector<Joint>& joints = problem_.robot->description().joints;
    for (const std::int32_t node : nodes) {
      if (!std::isnan(clearances_m_[idx(node)])) continue;
      const Eigen::VectorXd q = configuration(node);
      clearances_m_[idx(node)] = -kUnreached_m;
      const bool is_within = std::ranges::all_of(std::array{ways_.x_, ways_.y_}, [&](int j) {
        return q[j] >= joints[idx(j)].lower && q[j] <= joints[idx(j)].upper;
      });
      if (!is_within) continue;
      fresh_.push_back(node);
      q_.insert(q_.end(), q.begin(), q.end());
    }
    const std::vector<double>& found_m = clearances_of(q_);
    for (std::size_t i = 0; i < fresh_.size(); ++i) clearances_m_[idx(fresh_[i])] = found_m[i];
  }

  template <class Rows>
  const std::vector<double>& clearances_of(const Rows& q) {
    const RobotDescription& robot = problem_.robot->description();
    const std::size_t spheres = robot.spheres.size();
    const std::size_t rows = static_cast<std::size_t>(q.size()) / idx(robot.dof());
    centres_m_.resize(rows * spheres);
    distances_m_.resize(rows * spheres);
    statuses_.resize(rows * spheres);
    problem_.robot->sphere_centres(std::span(q.data(), static_cast<std::size_t>(q.size())),
                                   centres_m_, scratch_);
    query_with_policy(*problem_.field, problem_.space, centres_m_, distances_m_, {}, statuses_);
    rows_m_.assign(rows, kUnreached_m);
    for (std::size_t i = 0; i < rows * spheres; ++i) {
      double& clearance_m = rows_m_[i / spheres];
      clearance_m = std::min(clearance_m, distances_m_[i] - robot.spheres[i % spheres].radius_m);
    }
    return rows_m_;
  }

  const Problem& problem_;
  BaseWays& ways_;
  Eigen::Vector2d start_m_;
  std::vector<double> clearances_m_;  ///< Of positions; NaN: not looked at.
  std::vector<std::int32_t> fresh_;
  std::vector<double> q_;
  Scratch scratch_;
  std::vector<Eigen::Vector3d> centres_m_;
  std::vector<double> distances_m_;
  std::vector<FieldStatus> statuses_;
  std::vector<double> rows_m_;
};

BaseWays::BaseWays(const Problem& problem, const Deadline& deadline) {
  const auto base = problem.robot->description().planar_base();
  if (!base || !problem.field) return;
  std::tie(x_, y_) = std::pair((*base)[0], (*base)[1]);
  const GridSpec& grid = problem.field->info().grid;
  const Eigen::Vector2d size_m = (grid.upper_m() - grid.origin_m).head<2>();
  cell_m_ = std::max({kLeastCell_m, grid.resolution_m, size_m.maxCoeff() / kMostCells});
  goal_m_ = at(as_span(problem.goal.q));
  // The field's size either way: where a base's joints are zero is its own affair.
  half_ = (size_m / cell_m_).array().ceil().cast<int>();
  positions_.resize(idx(2 * half_.x() + 1) * idx(2 * half_.y() + 1));
  Search(problem, *this).run(deadline);
}

Eigen::Vector2d BaseWays::at(std::span<const double> q) const { return {q[idx(x_)], q[idx(y_)]}; }

Eigen::Vector2d BaseWays::position_m(std::int32_t node) const {
  const int width = 2 * half_.x() + 1;
  return goal_m_ + cell_m_ * Eigen::Vector2d(node % width - half_.x(), node / width - half_.y());
}

std::int32_t BaseWays::nearest(const Eigen::Vector2d& p_m) const {
  const Eigen::Vector2i cell = ((p_m - goal_m_) / cell_m_).array().round().cast<int>();
  const Eigen::Vector2i inside = cell.cwiseMax(-half_).cwiseMin(half_) + half_;
  return inside.y() * (2 * half_.x() + 1) + inside.x();
}

std::optional<double> BaseWays::length_m(std::span<const double> q) const {
  if (empty()) return std::nullopt;
  double least_m = kUnreached_m;
  for (int dy = -kBeside; dy <= kBeside; ++dy) {
    for (int dx = -kBeside; dx <= kBeside; ++dx) {
      const std::int32_t node = nearest(at(q) + cell_m_ * Eigen::Vector2d(dx, dy));
      const double cost_m = positions_[idx(node)].cost_m;
      least_m = std::min(least_m, cost_m + (position_m(node) - at(q)).norm());
    }
  }
  return std::isfinite(least_m) ? std::optional(least_m) : std::nullopt;
}

Trajectory BaseWays::first_guess(const Problem& problem) const {
  std::vector<Eigen::Vector2d> points_m{at(as_span(problem.start.q)) + to_turn_m_};
  for (std::int32_t node = first_; node >= 0; node = positions_[idx(node)].next) {
    points_m.push_back(position_m(node));
  }
  Places way = along(points_m);
  // All other joints wait until it can turn.
  const double aside_m = to_turn_m_.norm();
  std::vector<std::size_t> joints{idx(x_), idx(y_)};
  if (const auto& rolling = problem.robot->description().rolling) {
    way = rolled(way, problem, *rolling);
    joints.push_back(idx(rolling->yaw));
  }
  const double straight_m = (goal_m_ - at(as_span(problem.start.q))).norm();
  const double longer = straight_m > 0.0 ? std::max(1.0, way.length_m() / straight_m) : 1.0;
  const int last = static_cast<int>(std::ceil(longer * (problem.support_states - 1) - 1e-9));
  Trajectory guess = straight_line(problem.start, problem.goal, last + 1, problem.dt_s);
  for (int i = 1; i < last; ++i) {
    const double gone_m = way.length_m() * i / last;
    const Eigen::Vector3d place = way.at(gone_m);
    if (aside_m > 0.0) {
      const double share = std::max(0.0, gone_m - aside_m) / (way.length_m() - aside_m);
      Eigen::Map<Eigen::VectorXd>(guess.q(i).data(), guess.dof) =
          problem.start.q + share * (problem.goal.q - problem.start.q);
    }
    for (std::size_t k = 0; k < joints.size(); ++k) {
      guess.q(i)[joints[k]] = place[static_cast<int>(k)];
    }
  }
  for (int i = 1; i < last; ++i) {
    for (std::size_t j = 0; j < idx(guess.dof); ++j) {
      guess.qdot(i)[j] = (guess.q(i + 1)[j] - guess.q(i - 1)[j]) / (2.0 * problem.dt_s);
    }
  }
  return guess;
}

}  // namespace sidestep
