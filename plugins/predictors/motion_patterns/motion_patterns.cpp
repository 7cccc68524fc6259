#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <optional>

#include <sidestep/core/index.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "walkers.hpp"

namespace {

using namespace sidestep;

constexpr double kApart_s = 0.1;     ///< Between two remembered places of a track.
constexpr double kLeastAgo_s = 1.0;  ///< What is later is the present.

struct Options : Spread {
  double memory_s = 120.0;
  double same_place_m = 0.2;
  double same_velocity = 0.25;
  double turning_m = 0.6;

  static Parameters<Options> parameters() {
    return declare_spread<Options>()
        .add("memory_s", &Options::memory_s, "How long the places of a track are remembered.",
             {.unit = "s", .min = 1.0, .max = 3600.0})
        .add("same_place_m", &Options::same_place_m,
             "A track that is so near to where it was once, at the same velocity, does what it did "
             "then.",
             {.unit = "m", .min = 0.0, .max = 10.0})
        .add("same_velocity", &Options::same_velocity,
             "Share of its speed by which that velocity may differ.", {.min = 0.0, .max = 2.0})
        .add("turning_m", &Options::turning_m,
             "A track that has no such past may turn back so far from a wall that it heads for, "
             "or go on.",
             {.unit = "m", .min = 0.0, .max = 10.0});
  }
};

/// Where a track was, and how fast.
struct Place {
  double time_s;
  Eigen::Vector2d position_m;
  Eigen::Vector2d velocity_mps;
};
using History = std::deque<Place>;

/// What people have done at a place they do there again (motion patterns: Bennewitz, Burgard,
/// Cielniak and Thrun 2005), each by its own past.
class MotionPatterns final : public Predictor {
 public:
  explicit MotionPatterns(const Options& options) : options_(options) {}

  [[nodiscard]] Result<Prediction> predict(const PredictionRequest& request) override {
    remember(request.tracks);
    const std::vector<double> times_s = options_.times_s(request.horizon_s);
    std::vector<PredictedSet> sets;
    for (const Track& track : request.tracks.tracks) {
      const History& past = histories_.at(track.id);
      if (const auto then = same_before(track, past)) {
        sets.push_back(set_along(track, times_s, repeated(track, past, *then, times_s), options_));
        continue;
      }
      std::vector<Eigen::Vector2d> on, back;
      const auto turn_s = turning_time_s(track, request);
      for (const double time_s : times_s) {
        on.push_back(track.position_m + time_s * track.velocity_mps);
        const double back_s = turn_s ? std::max(0.0, time_s - *turn_s) : 0.0;
        back.push_back(on.back() - 2.0 * back_s * track.velocity_mps);
      }
      sets.push_back(set_along(track, times_s, on, options_));
      if (!turn_s) continue;
      sets.back().likelihood = 0.5;
      sets.push_back(set_along(track, times_s, back, options_));
      sets.back().likelihood = 0.5;
    }
    return Prediction::create(request.tracks.stamp, std::move(sets));
  }

 private:
  void remember(const Tracks& tracks) {
    const double now_s = tracks.stamp.seconds();
    for (const Track& track : tracks.tracks) {
      History& past = histories_[track.id];
      if (!past.empty() && now_s < past.back().time_s) past.clear();
      if (!past.empty() && now_s - past.back().time_s < kApart_s) continue;
      past.push_back({now_s, track.position_m, track.velocity_mps});
    }
    for (auto its = histories_.begin(); its != histories_.end();) {
      History& past = its->second;
      while (!past.empty() && now_s - past.front().time_s > options_.memory_s) past.pop_front();
      its = past.empty() ? histories_.erase(its) : std::next(its);
    }
  }

  /// When the track was last where it is, as fast.
  [[nodiscard]] std::optional<std::size_t> same_before(const Track& track,
                                                       const History& past) const {
    const double speed_mps = track.velocity_mps.norm();
    std::optional<std::size_t> nearest;
    double nearest_m = options_.same_place_m;
    for (std::size_t i = past.size(); i-- > 0;) {
      if (past.back().time_s - past[i].time_s < kLeastAgo_s) continue;
      const double apart_m = (past[i].position_m - track.position_m).norm();
      const double differs_mps = (past[i].velocity_mps - track.velocity_mps).norm();
      if (apart_m < nearest_m && differs_mps < options_.same_velocity * speed_mps) {
        nearest = i;
        nearest_m = apart_m;
      } else if (nearest) {
        break;  // before that it was on its way there
      }
    }
    return nearest;
  }

  /// What it did since, again and again.
  [[nodiscard]] static std::vector<Eigen::Vector2d> repeated(const Track& track,
                                                             const History& past, std::size_t then,
                                                             std::span<const double> times_s) {
    const double period_s = past.back().time_s - past[then].time_s;
    const Eigen::Vector2d off_m = track.position_m - past[then].position_m;
    std::vector<Eigen::Vector2d> path;
    for (const double time_s : times_s) {
      const double at_s = past[then].time_s + std::fmod(time_s, period_s);
      const auto after = std::ranges::lower_bound(past, at_s, {}, &Place::time_s);
      Eigen::Vector2d at_m = after == past.end() ? past.back().position_m : after->position_m;
      if (after != past.end() && after != past.begin()) {
        const Place& before = *std::prev(after);
        const double share = (at_s - before.time_s) / (after->time_s - before.time_s);
        at_m = before.position_m + share * (after->position_m - before.position_m);
      }
      path.push_back(at_m + off_m);
    }
    return path;
  }

  /// When it is as near to a wall that it heads for as people turn back; nothing where it does not
  /// come there within the horizon.
  [[nodiscard]] std::optional<double> turning_time_s(const Track& track,
                                                     const PredictionRequest& request) const {
    const double speed_mps = track.velocity_mps.norm();
    if (request.field == nullptr || !(speed_mps > 0.0)) return std::nullopt;
    constexpr double kStep_m = 0.1;
    const double step_s = std::max(kStep_m / speed_mps, 0.02);
    for (double time_s = 0.0; time_s <= request.horizon_s; time_s += step_s) {
      const Eigen::Vector2d at_m = track.position_m + time_s * track.velocity_mps;
      const auto wall = wall_beside(track, at_m, request.field);
      constexpr double kHeadOn = 0.7;  // a cosine
      if (wall && wall->distance_m < options_.turning_m &&
          -wall->normal.dot(track.velocity_mps) > kHeadOn * speed_mps) {
        return time_s;
      }
    }
    return std::nullopt;
  }

  Options options_;
  std::map<std::int64_t, History> histories_;
};

Result<std::unique_ptr<Predictor>> create(const Options& options, const HostContext&) {
  return std::make_unique<MotionPatterns>(options);
}

}  // namespace

SIDESTEP_PLUGIN(sidestep::Predictor, Options, create, "motion_patterns", "0.1.0",
                "Each track does what it did before at the same place and speed")
