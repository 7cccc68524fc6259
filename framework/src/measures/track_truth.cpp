#include <sidestep/measures/track_truth.hpp>

#include <algorithm>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// Nothing wider is a person.
constexpr double kWidest_m = 1.0;
constexpr double kMatch_m = 0.5;
constexpr double kMoving_mps = 0.05;
/// An object that was hidden for no longer than this has not left the view.
constexpr double kHidden_s = 1.0;
/// How long an object may be in view and moving before it is to be tracked.
constexpr double kDue_s = 1.0;

bool is_as_wide_as_people(const Shape& shape) {
  if (std::holds_alternative<HalfSpace>(shape)) return false;
  Eigen::AlignedBox2d box;
  const auto include = [&](const Mesh& mesh) {
    for (const Eigen::Vector3d& vertex : mesh.vertices_m) {
      box.extend(Eigen::Vector2d(vertex.head<2>()));
    }
  };
  if (const auto* mesh = std::get_if<std::shared_ptr<const Mesh>>(&shape)) {
    include(**mesh);
  } else {
    include(triangulate(shape));
  }
  return box.sizes().maxCoeff() <= kWidest_m;
}

}  // namespace

TrackTruth::TrackTruth(const Scene& scene) : scene_(scene) {
  for (std::size_t i = 0; i < scene.objects().size(); ++i) {
    const SceneObject& object = scene.objects()[i];
    if (!object.moves() || !is_as_wide_as_people(object.shape)) continue;
    // A body counts once, by its first part.
    const bool is_part =
        object.person >= 0 && i > 0 && scene.objects()[i - 1].person == object.person;
    if (!is_part) people_.push_back({.object = i});
  }
}

void TrackTruth::observe(const Tracks& tracks, std::span<const std::size_t> in_view) {
  const double now_s = tracks.stamp.seconds();
  const auto place = [&](const Person& person, double time_s) -> Eigen::Vector2d {
    return scene_.objects()[person.object].T_world_object(time_s).translation().head<2>();
  };
  // Pairs of a person and a track, the nearest first; each is in one at most.
  struct Pair {
    double distance_m;
    std::size_t person, track;
  };
  std::vector<Pair> pairs;
  for (std::size_t p = 0; p < people_.size(); ++p) {
    for (std::size_t t = 0; t < tracks.tracks.size(); ++t) {
      const double distance_m = (tracks.tracks[t].position_m - place(people_[p], now_s)).norm();
      if (distance_m <= kMatch_m) pairs.push_back({distance_m, p, t});
    }
  }
  std::ranges::sort(pairs, {}, &Pair::distance_m);
  std::vector<const Track*> track_of(people_.size(), nullptr);
  std::vector<bool> is_taken(tracks.tracks.size(), false);
  for (const Pair& pair : pairs) {
    true_ids_.insert(tracks.tracks[pair.track].id);
    if (track_of[pair.person] != nullptr || is_taken[pair.track]) continue;
    track_of[pair.person] = &tracks.tracks[pair.track];
    is_taken[pair.track] = true;
  }
  for (const Track& track : tracks.tracks) ids_.insert(track.id);
  constexpr double kInstant_s = 1e-3;
  for (std::size_t p = 0; p < people_.size(); ++p) {
    const Eigen::Vector2d velocity_mps =
        (place(people_[p], now_s) - place(people_[p], now_s - kInstant_s)) / kInstant_s;
    const bool is_seen = std::ranges::find(in_view, people_[p].object) != in_view.end();
    follow(people_[p], now_s, velocity_mps, is_seen, track_of[p]);
    if (!is_seen || track_of[p] == nullptr) continue;
    record_.position_error_m.push_back((track_of[p]->position_m - place(people_[p], now_s)).norm());
    record_.velocity_error_mps.push_back((track_of[p]->velocity_mps - velocity_mps).norm());
  }
}

void TrackTruth::follow(Person& person, double now_s, const Eigen::Vector2d& velocity_mps,
                        bool in_view, const Track* track) {
  if (!in_view) return;
  if (now_s - person.in_view_s > kHidden_s) person = {.object = person.object};
  person.in_view_s = now_s;
  if (person.moved_since_s < 0.0 && velocity_mps.norm() < kMoving_mps) return;
  if (person.moved_since_s < 0.0) person.moved_since_s = now_s;
  const bool is_due = now_s - person.moved_since_s >= kDue_s;
  record_.due_frames += is_due ? 1 : 0;
  if (track == nullptr) return;
  record_.found_frames += is_due ? 1 : 0;
  if (!person.is_found) record_.delay_s.push_back(now_s - person.moved_since_s);
  person.is_found = true;
  record_.switches += person.id != 0 && person.id != track->id ? 1 : 0;
  person.id = track->id;
}

TrackRecord TrackTruth::finish() const {
  TrackRecord record = record_;
  record.false_tracks =
      std::ranges::count_if(ids_, [&](std::int64_t id) { return !true_ids_.contains(id); });
  return record;
}

}  // namespace sidestep
