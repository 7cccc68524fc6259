#include <sidestep/planning/prediction_check.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/trajectory/rolling.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "cubic_motion.hpp"

namespace sidestep {
namespace {

constexpr int kLevels = 8;  ///< Speeds: k / kLevels of the trajectory's.
constexpr double kLeastStep_s = 0.1;
constexpr double kMostStep_s = 1.0;
constexpr int kSamples = 4;          ///< States of the result in a step.
constexpr double kOverLimit = 1.05;  ///< Of accelerations, between what is looked at.
/// The plane is searched with so much more than the margin, until what comes out is proven clear.
constexpr std::array kSlack{0.5, 1.0, 2.0, 4.0};

/// The path of a trajectory, its own time s as parameter.
class Path {
 public:
  Path(const Trajectory& trajectory, double from_s) : trajectory_(trajectory), from_s_(from_s) {
    for (int state = 0; state + 1 < trajectory.size(); ++state)
      pieces_.emplace_back(trajectory, state);
  }

  [[nodiscard]] double duration_s() const noexcept { return trajectory_.duration_s() - from_s_; }
  void position(double s, std::span<double> q) const { trajectory_.sample(from_s_ + s, q, {}); }
  void state(double s, std::span<double> q, std::span<double> velocity) const {
    trajectory_.sample(from_s_ + s, q, velocity);
  }
  /// Whether the joints keep their accelerations where s moves at `speed`, which changes by `rate`
  /// in a second.
  [[nodiscard]] bool keeps(const MotionLimits& limits, double s, double speed, double rate) const {
    const double at_s = from_s_ + s;
    const auto after = std::ranges::upper_bound(trajectory_.times_s, at_s);
    const auto piece = std::clamp<std::ptrdiff_t>(after - trajectory_.times_s.begin() - 1, 0,
                                                  std::ssize(pieces_) - 1);
    const CubicMotion& cubics = pieces_[static_cast<std::size_t>(piece)];
    const double in_s = std::min(at_s, cubics.end_s()) - cubics.begin_s();
    for (std::size_t j = 0; j < limits.acceleration.size(); ++j) {
      const Cubic& cubic = cubics.joints()[j];
      const double along = cubic.acceleration(in_s);
      // Where the trajectory itself is beyond a limit, as far again will do.
      const double most = kOverLimit * std::max(limits.acceleration[j], std::abs(along));
      if (std::abs(along * speed * speed + cubic.velocity(in_s) * rate) > most) return false;
    }
    return true;
  }
  /// The longest time in which any joint needs to come to rest from its greatest speed.
  [[nodiscard]] double ramp_s(const MotionLimits& limits) const {
    double ramp_s = 0.0;
    for (const CubicMotion& piece : pieces_) {
      for (std::size_t j = 0; j < limits.acceleration.size(); ++j) {
        if (!(limits.acceleration[j] > 0.0)) continue;
        ramp_s = std::max(ramp_s, std::abs(piece.joints()[j].v0) / limits.acceleration[j]);
      }
    }
    return ramp_s;
  }

 private:
  const Trajectory& trajectory_;
  double from_s_;
  std::vector<CubicMotion> pieces_;
};

/// The s-t plane: instants `step_s` apart, and places that two neighbouring speeds reach in a step.
class PathTimePlane {
 public:
  PathTimePlane(const Path& path, double step_s, const PredictionOnClock& predicted, double from_s,
                const PredictionCheck& check)
      : path_(path),
        step_s_(step_s),
        place_s_(step_s / (2.0 * kLevels)),
        predicted_(predicted),
        from_s_(from_s),
        check_(check),
        spheres_(check.robot().description().spheres.size()) {
    places_ = static_cast<int>(std::ceil(path.duration_s() / place_s_)) + 1;
    const double left_s = predicted.prediction->end_s() - predicted.from_s - from_s;
    layers_ = std::max(1, static_cast<int>(std::ceil(left_s / step_s))) + 1;
    places_ = std::min(places_, layers_ * 2 * kLevels + 1);
    centres_m_.resize(idx(places_) * spheres_);
    has_centres_.assign(idx(places_), 0);
    distances_m_.resize(spheres_);
    q_.resize(idx(check.robot().description().dof()));
  }

  [[nodiscard]] int layers() const noexcept { return layers_; }
  [[nodiscard]] int places() const noexcept { return places_; }
  [[nodiscard]] double s_of(int place) const noexcept {
    return std::min(place * place_s_, path_.duration_s());
  }

  /// Least clearance at a place and an instant.
  double clearance_m(int place, int layer) {
    const std::span centres(centres_m_.data() + idx(place) * spheres_, spheres_);
    if (has_centres_[idx(place)] == 0) {
      path_.position(s_of(place), q_);
      check_.robot().sphere_centres(q_, centres, scratch_);
      has_centres_[idx(place)] = 1;
    }
    const double time_s = predicted_.from_s + from_s_ + layer * step_s_;
    predicted_.prediction->query(std::min(time_s, predicted_.prediction->end_s()), centres,
                                 distances_m_, {});
    double least_m = std::numeric_limits<double>::infinity();
    const auto& spheres = check_.robot().description().spheres;
    for (std::size_t s = 0; s < spheres_; ++s) {
      least_m = std::min(least_m, distances_m_[s] - spheres[s].radius_m);
    }
    return least_m;
  }

 private:
  const Path& path_;
  double step_s_;
  double place_s_;
  const PredictionOnClock& predicted_;
  double from_s_;
  const PredictionCheck& check_;
  std::size_t spheres_;
  int places_ = 0;
  int layers_ = 0;
  std::vector<Eigen::Vector3d> centres_m_;  ///< By place.
  std::vector<char> has_centres_;
  std::vector<double> distances_m_;
  std::vector<double> q_;
  Scratch scratch_;
};

/// Where a motion is in the plane at one instant.
struct PlaneNode {
  int place = 0;
  int level = 0;
};

/// Finds the motion through the plane that is first at the path's end, or else farthest at the last
/// instant.
class PlaneSearch {
 public:
  PlaneSearch(PathTimePlane& plane, const Path& path, const MotionLimits& limits, double step_s)
      : plane_(plane), path_(path), limits_(limits), step_s_(step_s) {}

  /// One node an instant; empty where there is no such motion. `required_m`: of clearance.
  [[nodiscard]] std::vector<PlaneNode> run(bool starts_at_rest, double required_m) {
    may_change_.resize(idx(plane_.places()) * kWidth * 3, kUnknown);
    came_from_.assign(idx(plane_.layers()) * idx(plane_.places()) * kWidth, kUnreached);
    farthest_ = 0;
    for (int level = starts_at_rest ? 0 : kLevels; level <= kLevels; ++level) {
      came_from_[index(0, {0, level})] = 0;
    }
    int layer = 0;
    while (layer + 1 < plane_.layers() && plane_.s_of(farthest_) < path_.duration_s()) {
      advance(layer++, required_m);
    }
    return trace_back(layer);
  }

 private:
  static constexpr std::size_t kWidth = kLevels + 1;
  static constexpr std::int32_t kUnreached = -1;
  static constexpr std::int8_t kUnknown = -1;

  [[nodiscard]] std::size_t index(int layer, PlaneNode node) const noexcept {
    return (idx(layer) * idx(plane_.places()) + idx(node.place)) * kWidth + idx(node.level);
  }

  void advance(int layer, double required_m) {
    is_clear_.assign(idx(plane_.places()), kUnknown);
    const int last = farthest_;
    for (int place = 0; place <= last; ++place) {
      for (int level = 0; level <= kLevels; ++level) {
        if (came_from_[index(layer, {place, level})] == kUnreached) continue;
        for (int next = std::max(0, level - 1); next <= std::min(kLevels, level + 1); ++next) {
          step(layer, {place, level}, next, required_m);
        }
      }
    }
  }

  /// Whether the limits let the speed change so in a step that begins or ends there.
  bool may_change(PlaneNode node, int change) {
    std::int8_t& known =
        may_change_[(idx(node.place) * kWidth + idx(node.level)) * 3 + idx(change + 1)];
    if (known == kUnknown) {
      const double rate = change / (kLevels * step_s_);
      known = path_.keeps(limits_, plane_.s_of(node.place), share(node.level), rate) ? 1 : 0;
    }
    return known == 1;
  }

  void step(int layer, PlaneNode node, int next, double required_m) {
    const PlaneNode to{std::min(node.place + node.level + next, plane_.places() - 1), next};
    std::int32_t& from = came_from_[index(layer + 1, to)];
    if (from != kUnreached) return;
    const int change = next - node.level;
    if (!may_change(node, change) || !may_change(to, change)) return;
    std::int8_t& clear = is_clear_[idx(to.place)];
    if (clear == kUnknown) clear = plane_.clearance_m(to.place, layer + 1) >= required_m ? 1 : 0;
    if (clear == 0) return;
    from = node.place * static_cast<std::int32_t>(kWidth) + node.level;
    farthest_ = std::max(farthest_, to.place);
  }

  [[nodiscard]] std::vector<PlaneNode> trace_back(int end) const {
    std::vector<PlaneNode> nodes;
    for (int place = farthest_; place >= 0 && nodes.empty(); --place) {
      for (int level = kLevels; level >= 0 && nodes.empty(); --level) {
        if (came_from_[index(end, {place, level})] != kUnreached) nodes.push_back({place, level});
      }
    }
    for (int layer = end; layer > 0 && !nodes.empty(); --layer) {
      const std::int32_t before = came_from_[index(layer, nodes.back())];
      const auto width = static_cast<std::int32_t>(kWidth);
      nodes.push_back({before / width, before % width});
    }
    std::ranges::reverse(nodes);
    return nodes;
  }

  [[nodiscard]] static double share(int level) noexcept {
    return static_cast<double>(level) / kLevels;
  }

  PathTimePlane& plane_;
  const Path& path_;
  const MotionLimits& limits_;
  double step_s_;
  std::vector<std::int32_t> came_from_;  ///< By index(): place * kWidth + level of the node before.
  std::vector<std::int8_t> is_clear_;    ///< By place, of the layer being entered.
  std::vector<std::int8_t> may_change_;  ///< By place, level and change.
  int farthest_ = 0;
};

/// Writes the motion that a way through the plane stands for.
class MotionWriter {
 public:
  MotionWriter(const Trajectory& trajectory, const Path& path) : path_(path) {
    motion_.dof = trajectory.dof;
    q_.resize(idx(trajectory.dof));
    velocity_.resize(q_.size());
  }

  /// From place `s` on, for a step in which the speed changes evenly.
  void step(double s, double from_speed, double to_speed, double step_s) {
    if (motion_.size() == 0) write(s, from_speed, 0.0);
    for (int k = 1; k <= kSamples; ++k) {
      const double t = step_s * k / kSamples;
      const double speed = from_speed + (to_speed - from_speed) * t / step_s;
      write(s + 0.5 * (from_speed + speed) * t, speed, begin_s_ + t);
      if (s_ >= path_.duration_s()) return;
    }
    begin_s_ += step_s;
  }
  [[nodiscard]] double s() const noexcept { return s_; }
  [[nodiscard]] Trajectory take() { return std::move(motion_); }

 private:
  void write(double s, double speed, double time_s) {
    s_ = std::min(s, path_.duration_s());
    path_.state(s_, q_, velocity_);
    motion_.times_s.push_back(time_s);
    motion_.positions.insert(motion_.positions.end(), q_.begin(), q_.end());
    for (const double v : velocity_) motion_.velocities.push_back(speed * v);
  }

  const Path& path_;
  Trajectory motion_;
  std::vector<double> q_, velocity_;
  double begin_s_ = 0.0;
  double s_ = 0.0;
};

/// The motion through those nodes, and then on to the path's end.
Trajectory motion_of(const std::vector<PlaneNode>& nodes, const Trajectory& trajectory,
                     const Path& path, const MotionLimits& limits, double step_s) {
  MotionWriter writer(trajectory, path);
  const auto share = [](int level) { return static_cast<double>(level) / kLevels; };
  for (std::size_t k = 1; k < nodes.size() && (k == 1 || writer.s() < path.duration_s()); ++k) {
    const double s = k == 1 ? 0.0 : writer.s();
    writer.step(s, share(nodes[k - 1].level), share(nodes[k].level), step_s);
  }
  int level = nodes.back().level;
  while (writer.s() < path.duration_s()) {
    // Faster as soon as the limits allow; what has come to rest sets out in any case.
    const double rate = 1.0 / (kLevels * step_s);
    const bool may_rise = level < kLevels && path.keeps(limits, writer.s(), share(level), rate) &&
                          path.keeps(limits, writer.s(), share(level + 1), rate);
    const int next = may_rise || level == 0 ? level + 1 : level;
    writer.step(writer.s(), share(level), share(next), step_s);
    level = next;
  }
  return writer.take();
}

}  // namespace

bool keeps_limits(const Trajectory& motion, const MotionLimits& limits) {
  if (motion.size() < 2 || limits.velocity.size() != idx(motion.dof)) return false;
  for (const double v : motion.qdot(motion.size() - 1)) {
    if (v != 0.0) return false;
  }
  for (int state = 0; state + 1 < motion.size(); ++state) {
    const CubicMotion piece(motion, state);
    const double end_s = piece.duration_s();
    for (std::size_t j = 0; j < limits.velocity.size(); ++j) {
      const Cubic& cubic = piece.joints()[j];
      const double turn_s = cubic.inflection();
      for (const double s : {0.0, end_s, turn_s > 0.0 && turn_s < end_s ? turn_s : 0.0}) {
        if (std::abs(cubic.velocity(s)) > limits.velocity[j] * (1.0 + 1e-6)) return false;
        if (std::abs(cubic.acceleration(s)) > kOverLimit * limits.acceleration[j]) return false;
      }
    }
  }
  return true;
}

std::optional<Trajectory> retime_among(const Trajectory& trajectory, double from_s,
                                       const MotionLimits& limits,
                                       const PredictionOnClock& predicted,
                                       const PredictionCheck& check) {
  if (!check.first_conflict(trajectory, 0.0, predicted)) return trajectory;
  if (!(trajectory.duration_s() - from_s > kLeastStep_s)) return std::nullopt;
  const Path path(trajectory, from_s);
  const double step_s =
      std::clamp(kOverLimit * path.ramp_s(limits) / kLevels, kLeastStep_s, kMostStep_s);
  PathTimePlane plane(path, step_s, predicted, from_s, check);
  std::vector<double> q(idx(trajectory.dof)), velocity(q.size());
  trajectory.sample(from_s, q, velocity);
  const bool starts_at_rest = std::ranges::all_of(velocity, [](double v) { return v == 0.0; });
  PlaneSearch search(plane, path, limits, step_s);
  // Between two instants a set may come so much nearer, and go again.
  const double between_m = 0.5 * step_s * predicted.prediction->speed_mps();
  for (const double slack : kSlack) {
    const double required_m =
        std::min(check.margin_m() + slack * between_m, plane.clearance_m(0, 0));
    const std::vector<PlaneNode> nodes = search.run(starts_at_rest, required_m);
    if (nodes.empty()) continue;
    Trajectory motion = motion_of(nodes, trajectory, path, limits, step_s);
    if (limits.rolling && !roll(*limits.rolling, motion)) continue;
    if (from_s > 0.0) motion = joined(cut(trajectory, 0.0, from_s), motion);
    if (!check.first_conflict(motion, 0.0, predicted)) return motion;
  }
  return std::nullopt;
}

}  // namespace sidestep
