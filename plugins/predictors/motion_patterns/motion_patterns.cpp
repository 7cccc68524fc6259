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

constexpr double kSampling_s = 0.1;   ///< Between two remembered places of a track.
constexpr double kMinPeriod_s = 1.0;  ///< What is later is the present.

struct Options : Spread {
  double memory_s = 120.0;
  double match_distance_m = 0.2;
  double match_velocity_share = 0.25;
  double turning_m = 0.6;

  static Parameters<Options> parameters() {
    return declare_spread<Options>()
        .add("memory_s", &Options::memory_s, "How long the places of a track are remembered.",
             {.unit = "s", .min = 1.0, .max = 3600.0})
        .add("match_distance_m", &Options::match_distance_m,
             "Largest distance to a past position that counts as the same place.",
             {.unit = "m", .min = 0.0, .max = 10.0})
        .add("match_velocity_share", &Options::match_velocity_share,
             "Share of its speed by which a past velocity may differ to count as the same.",
             {.min = 0.0, .max = 2.0})
        .add("turning_m", &Options::turning_m,
             "Distance of a track's axis from a wall that it heads for at which it may turn back, "
             "where it has no such past; both alternatives are predicted.",
             {.unit = "m", .min = 0.0, .max = 10.0});
  }
};

/// Where a track was, and how fast.
struct PastState {
  double time_s;
  Eigen::Vector2d position_m;
  Eigen::Vector2d velocity_mps;
};
using History = std::deque<PastState>;

/// Replays each track's own past: from the nearest of the latest moments at the same position and
/// velocity on, its path since then is repeated. A simplification of learned motion patterns
/// (Bennewitz, Burgard, Cielniak and Thrun 2005), which are of many people.
class MotionPatterns final : public Predictor {
 public:
  explicit MotionPatterns(const Options& options) : options_(options) {}

  [[nodiscard]] Result<Prediction> predict(const PredictionRequest& request) override {
    remember(request.tracks);
    const std::vector<double> times_s = options_.times_s(request.horizon_s);
    std::vector<PredictedSet> sets;
    for (const Track& track : request.tracks.tracks) {
      const History& past = histories_.at(track.id);
      if (const auto then = find_past_match(track, past)) {
        sets.push_back(set_along(track, times_s, repeated(track, past, *then, times_s), options_));
        continue;
      }
      const auto turn_s = turning_time_s(track, request);
      sets.push_back(set_along(track, times_s, straight_path(track, times_s), options_));
      if (!turn_s) continue;
      sets.push_back(set_along(track, times_s, straight_path(track, times_s, *turn_s), options_));
      for (auto set : {1, 2}) sets[sets.size() - idx(set)].likelihood = 0.5;
    }
    return Prediction::create(request.tracks.stamp, std::move(sets));
  }

 private:
  void remember(const Tracks& tracks) {
    const double now_s = tracks.stamp.seconds();
    for (const Track& track : tracks.tracks) {
      History& past = histories_[track.id];
      if (!past.empty() && now_s < past.back().time_s) past.clear();
      if (!past.empty() && now_s - past.back().time_s < kSampling_s) continue;
      past.push_back({now_s, track.position_m, track.velocity_mps});
    }
    for (auto its = histories_.begin(); its != histories_.end();) {
      History& past = its->second;
      while (!past.empty() && now_s - past.front().time_s > options_.memory_s) past.pop_front();
      its = past.empty() ? histories_.erase(its) : std::next(its);
    }
  }

  /// When the track was last where it is, as fast.
  [[nodiscard]] std::optional<std::size_t> find_past_match(const Track& track,
                                                           const History& past) const {
    const double speed_mps = track.velocity_mps.norm();
    std::optional<std::size_t> nearest;
    double nearest_m = options_.match_distance_m;
    for (std::size_t i = past.size(); i-- > 0;) {
      if (past.back().time_s - past[i].time_s < kMinPeriod_s) continue;
      const double apart_m = (past[i].position_m - track.position_m).norm();
      const double differs_mps = (past[i].velocity_mps - track.velocity_mps).norm();
      if (apart_m < nearest_m && differs_mps < options_.match_velocity_share * speed_mps) {
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
      // Within the period, so that there is a state after it; the first of them is no earlier.
      const double at_s = past[then].time_s + std::fmod(time_s, period_s);
      const auto after =
          std::upper_bound(past.begin() + static_cast<std::ptrdiff_t>(then), std::prev(past.end()),
                           at_s, [](double t, const PastState& state) { return t < state.time_s; });
      const PastState& before = *std::prev(after);
      const double share = (at_s - before.time_s) / (after->time_s - before.time_s);
      path.push_back(off_m + before.position_m + share * (after->position_m - before.position_m));
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
    constexpr double kMostSteps = 1e4;
    const int steps = static_cast<int>(std::min(request.horizon_s / step_s, kMostSteps));
    for (int step = 0; step <= steps; ++step) {
      const double time_s = step * step_s;
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
