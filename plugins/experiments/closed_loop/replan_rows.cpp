#include "replan_rows.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/geometry/ray_caster.hpp>

namespace sidestep {
namespace {

constexpr double kSeenFor_s = 0.5;
/// Rays per side of an image: an object that none of them meets is as good as unseen.
constexpr int kRays = 64;

/// Fastest joint of the robot about a time.
double speed_at(const std::vector<TruePose>& poses, double time_s) {
  const auto after = std::ranges::lower_bound(poses, time_s, {}, &TruePose::time_s);
  if (poses.size() < 2) return 0.0;
  const auto at = std::clamp<std::ptrdiff_t>(after - poses.begin(), 1,
                                             static_cast<std::ptrdiff_t>(poses.size()) - 1);
  const TruePose& a = poses[idx(at - 1)];
  const TruePose& b = poses[idx(at)];
  return (b.q - a.q).cwiseAbs().maxCoeff() / std::max(1e-9, b.time_s - a.time_s);
}

bool shows(const CameraView& view, const RayCaster& caster, int object) {
  std::vector<Eigen::Vector3d> origins(kRays, view.T_world_camera.translation());
  std::vector<Eigen::Vector3d> directions(kRays);
  std::vector<RayHit> hits(kRays);
  for (int v = 0; v < kRays; ++v) {
    for (int u = 0; u < kRays; ++u) {
      const double column = (u + 0.5) / kRays * view.camera.width_px - 0.5;
      const double row = (v + 0.5) / kRays * view.camera.height_px - 0.5;
      directions[idx(u)] =
          view.T_world_camera.linear() * view.camera.unproject(column, row, 1.0).normalized();
    }
    caster.cast(origins, directions, hits);
    if (std::ranges::any_of(hits, [&](const RayHit& hit) { return hit.object == object; })) {
      return true;
    }
  }
  return false;
}

constexpr int kRound = 24;  ///< Corners of a circle.
constexpr int kPathPoints = 200;

/// Andrew's monotone chain.
std::vector<Eigen::Vector2d> convex_hull(std::vector<Eigen::Vector2d> points) {
  std::ranges::sort(points, [](const auto& a, const auto& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  const auto turn = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                       const Eigen::Vector2d& c) {
    return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
  };
  std::vector<Eigen::Vector2d> hull;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t base = hull.size();
    for (const Eigen::Vector2d& point : points) {
      while (hull.size() >= base + 2 && turn(hull[hull.size() - 2], hull.back(), point) <= 0.0) {
        hull.pop_back();
      }
      hull.push_back(point);
    }
    if (!hull.empty()) hull.pop_back();
    std::ranges::reverse(points);
  }
  return hull;
}

/// A robot's spheres from above, and the way of the one nearest to the root and of the last.
class FromAbove {
 public:
  explicit FromAbove(const RobotModel& robot)
      : robot_(robot), centres_(robot.description().spheres.size()) {}

  [[nodiscard]] bool has_spheres() const { return !centres_.empty(); }
  /// x, y and radius of each sphere.
  StoredArray spheres(std::span<const double> q) {
    robot_.sphere_centres(q, centres_, scratch_);
    StoredArray array;
    for (std::size_t s = 0; s < centres_.size(); ++s) {
      const double radius_m = robot_.description().spheres[s].radius_m;
      array.add_row(std::array{centres_[s].x(), centres_[s].y(), radius_m});
    }
    return array;
  }
  void go_to(std::span<const double> q) {
    robot_.sphere_centres(q, centres_, scratch_);
    base_.add_row(std::array{centres_.front().x(), centres_.front().y()});
    hand_.add_row(std::array{centres_.back().x(), centres_.back().y()});
  }
  /// Records where it went since the last call.
  void record_way(const std::string& series, std::int64_t item, const std::string& key,
                  Recorder& recorder) {
    recorder.add_filled(series, item, key + ".base", std::exchange(base_, {}));
    recorder.add_filled(series, item, key + ".hand", std::exchange(hand_, {}));
  }

 private:
  const RobotModel& robot_;
  std::vector<Eigen::Vector3d> centres_;
  Scratch scratch_;
  StoredArray base_, hand_;
};

/// Goes what is left to follow at a time, if anything is followed.
void go_ahead(const EpisodeRecord& episode, double time_s, FromAbove& view) {
  const FollowedPath* followed = nullptr;
  for (const FollowedPath& path : episode.followed) {
    if (path.start_s <= time_s && path.trajectory.size() > 0) followed = &path;
  }
  if (followed == nullptr) return;
  const Trajectory& trajectory = followed->trajectory;
  std::vector<double> q(static_cast<std::size_t>(trajectory.dof));
  const double from_s = time_s - followed->start_s;
  for (int i = 0; i <= kPathPoints; ++i) {
    const double share = static_cast<double>(i) / kPathPoints;
    trajectory.sample(from_s + share * std::max(0.0, trajectory.duration_s() - from_s), q, {});
    view.go_to(q);
  }
}

/// Series "picture/EPISODE", as record_episode() says.
void record_pictures(const EpisodeRecord& episode, const RobotModel& robot, int pictures,
                     Recorder& recorder) {
  FromAbove view(robot);
  if (episode.poses.empty() || !view.has_spheres()) return;
  const std::string series = "picture/" + std::to_string(episode.episode);
  for (int p = 0; p < pictures; ++p) {
    const double share = pictures == 1 ? 1.0 : static_cast<double>(p) / (pictures - 1);
    const double time_s = episode.begin_s + share * episode.duration_s;
    const auto after = std::ranges::lower_bound(episode.poses, time_s, {}, &TruePose::time_s);
    const auto at = std::min<std::size_t>(static_cast<std::size_t>(after - episode.poses.begin()),
                                          episode.poses.size() - 1);
    recorder.add(series, p, "time_s", time_s);
    recorder.add(series, p, "robot", view.spheres(as_span(episode.poses[at].q)));
    for (std::size_t i = 0; i <= at; i += 1 + at / kPathPoints) {
      view.go_to(as_span(episode.poses[i].q));
    }
    view.record_way(series, p, "way", recorder);
    go_ahead(episode, time_s, view);
    view.record_way(series, p, "plan", recorder);
    recorder.add(series, p, "goal", view.spheres(as_span(episode.q_goal)));
    if (!episode.scene) continue;
    int count = 0;
    for (const SceneObject& object : episode.scene->objects()) {
      const auto outline = outline_from_above(object.shape, object.T_world_object(time_s));
      if (outline.empty()) continue;
      const std::string key = "object." + std::to_string(count++);
      StoredArray corners;
      for (const Eigen::Vector2d& corner : outline) corners.add_row(corner);
      recorder.add(series, p, key, corners);
      recorder.add(series, p, key + ".moves", object.moves());
    }
    recorder.add(series, p, "objects", count);
  }
}

constexpr std::size_t kPathEvery = 5;  ///< True states, of 125 Hz.

constexpr const char* kFile = "results.sqlite";

StoredRow<ReplanHead> stored_head() {
  return StoredRow<ReplanHead>()
      .add("about", &ReplanHead::about)
      .add("again", &ReplanHead::again)
      .add("first_episode", &ReplanHead::first_episode)
      .add("episodes", &ReplanHead::episodes);
}

const StoredRow<EventRow>& stored_event() {
  using E = EventRow;
  static const auto kEvent =
      StoredRow<E>()
          .add("episode", &E::episode)
          .add("kind", &E::kind)
          .add_derived("kind_name", [](const E& event) { return to_string(event.kind); })
          .add(
              "time_s", [](const E& event) { return event.stamp.seconds(); },
              [](E& event, double time_s) { event.stamp = Stamp::from_seconds(time_s); })
          .add_derived("cause", &E::cause)
          .add("solve_ms", &E::solve_ms)
          .add_derived("reason", [](const E& event) { return to_string(event.reason); })
          .add_derived("guess", &E::guess)
          .add("attempts", &E::attempts)
          .add("cost", &E::cost)
          .add("splice_velocity_jump", &E::splice_velocity_jump)
          .add_derived("takeover_s", [](const E& event) { return event.takeover.seconds(); })
          .add_derived("map_stamp_s", [](const E& event) { return event.map_stamp.seconds(); })
          .add("unknown_share", &E::unknown_share)
          .add("map_age_ms", &E::map_age_ms)
          .add("stamp_to_trajectory_ms", &E::stamp_to_trajectory_ms)
          .add("frame_to_trajectory_ms", &E::frame_to_trajectory_ms);
  return kEvent;
}

const StoredRow<ContactRow>& stored_contact() {
  using C = ContactRow;
  static const auto kContact = StoredRow<C>()
                                   .add("episode", &C::episode)
                                   .add("link", &C::link)
                                   .add("object", &C::object)
                                   .add("begin_s", &C::begin_s)
                                   .add("end_s", &C::end_s)
                                   .add("depth_m", &C::depth_m)
                                   .add("approach_mps", &C::approach_mps)
                                   .add("is_own", &C::is_own)
                                   .add("cause", &C::cause);
  return kContact;
}

using GuessRow = OfEpisode<Replanner::GuessCount>;

const StoredRow<GuessRow>& stored_guess() {
  static const auto kGuess = StoredRow<GuessRow>()
                                 .add("episode", &GuessRow::episode)
                                 .add("name", &GuessRow::guess)
                                 .add("tried", &GuessRow::tried)
                                 .add("led", &GuessRow::led);
  return kGuess;
}

/// Declares a part of what was measured of an episode's tracks; nothing where it was not.
template <class Value>
void add_track_part(StoredRow<EpisodeRow>& row, const char* key, Value TrackRecord::*part) {
  row.add(
      key,
      [part](const EpisodeRow& episode) {
        return episode.tracks ? std::optional((*episode.tracks).*part) : std::nullopt;
      },
      [part](EpisodeRow& episode, std::optional<Value> value) {
        if (!episode.tracks) episode.tracks.emplace();
        (*episode.tracks).*part = *std::move(value);
      });
}

const StoredRow<EpisodeRow>& stored_episode() {
  using E = EpisodeRow;
  using T = TrackRecord;
  static const auto kEpisode = [] {
    auto row = StoredRow<E>()
                   .add("success", &E::success)
                   .add("reached", &E::reached)
                   .add("reason", &E::reason)
                   .add("begin_s", &E::begin_s)
                   .add("duration_s", &E::duration_s)
                   .add("path_length", &E::path_length)
                   .add("head_way_rad", &E::head_way_rad)
                   .add("goal_error_m", &E::goal_error_m)
                   .add("motions", &E::motions)
                   .add("proven_motions", &E::proven_motions)
                   .add("broken_policies", &E::broken_policies)
                   .add("collisions", &E::collisions)
                   .add("steps", &E::steps)
                   .add("checks", &E::checks)
                   .add("frames", &E::frames)
                   .add("frames_dropped", &E::frames_dropped)
                   .add("free_run_s", &E::free_run_s)
                   .add("min_true_clearance_m", &E::min_true_clearance_m)
                   .add("nearest_link", &E::nearest_link)
                   .add("nearest_object", &E::nearest_object)
                   .add("nearest_s", &E::nearest_s)
                   .add("appear_frames", &E::appear_frames)
                   .add("clear_frames", &E::clear_frames)
                   .add("ghost_vox", &E::ghost_vox)
                   .add("entered_vox", &E::entered_vox)
                   .add("seen_vox", &E::seen_vox);
    add_track_part(row, "tracks.due_frames", &T::due_frames);
    add_track_part(row, "tracks.found_frames", &T::found_frames);
    add_track_part(row, "tracks.delay_s", &T::delay_s);
    add_track_part(row, "tracks.switches", &T::switches);
    add_track_part(row, "tracks.position_error_m", &T::position_error_m);
    add_track_part(row, "tracks.velocity_error_mps", &T::velocity_error_mps);
    add_track_part(row, "tracks.false_tracks", &T::false_tracks);
    return row;
  }();
  return kEpisode;
}

StoredArray mapping_array(const std::vector<MappedFrame>& frames) {
  StoredArray array;
  for (const MappedFrame& frame : frames) {
    array.add_row(std::array{frame.stamp_s, frame.received_s, frame.published_s, frame.integrate_ms,
                             frame.field_ms});
  }
  return array;
}

/// Time, then every joint.
StoredArray motion_array(const std::vector<TruePose>& poses) {
  StoredArray array;
  for (std::size_t i = 0; i < poses.size(); i += kPathEvery) {
    std::vector<double> row{poses[i].time_s};
    row.insert(row.end(), poses[i].q.begin(), poses[i].q.end());
    array.add_row(row);
  }
  return array;
}

/// Where the first and the last link are that a sphere is on.
struct Ends {
  Eigen::Vector3d base, hand;
};

Ends ends_at(const RobotModel& robot, const Eigen::VectorXd& q) {
  const RobotDescription& described = robot.description();
  const auto [first, last] = std::ranges::minmax(described.spheres, {}, &CollisionSphere::link);
  std::vector<Transform> T_world_link(described.links.size());
  Scratch scratch;
  robot.link_poses(as_span(q), T_world_link, scratch);
  return {T_world_link[idx(first.link)].translation(), T_world_link[idx(last.link)].translation()};
}

/// How near the robot came to anything over an episode, and how fast base and hand went: of each
/// time its seconds, m, m/s and m/s; nothing where the truth is not known.
StoredArray course_of(const EpisodeRecord& episode, const RobotModel& robot) {
  StoredArray course;
  if (!episode.scene || robot.description().spheres.empty()) return course;
  std::optional<Ends> before;
  double before_s = 0.0;
  for (const auto& [time_s, clearance_m] : episode.truth.clearances) {
    const auto pose = std::ranges::lower_bound(episode.poses, time_s, {}, &TruePose::time_s);
    const Ends now = ends_at(robot, pose->q);
    const auto speed = [&, dt_s = time_s - before_s](Eigen::Vector3d Ends::*end) {
      return before ? (now.*end - (*before).*end).norm() / dt_s : 0.0;
    };
    course.add_row(std::array{time_s, clearance_m, speed(&Ends::base), speed(&Ends::hand)});
    before = now;
    before_s = time_s;
  }
  return course;
}

EpisodeRow row_of(const EpisodeRecord& episode) {
  EpisodeRow row;
  static_cast<EpisodeFigures&>(row) = episode;
  row.success = episode.success();
  if (!episode.poses.empty()) row.path_length = 0.0;
  for (std::size_t i = 1; i < episode.poses.size(); ++i) {
    const TruePose& before = episode.poses[i - 1];
    const TruePose& now = episode.poses[i];
    *row.path_length += (now.q - before.q).norm();
    if (!before.head || !now.head) continue;
    row.head_way_rad = row.head_way_rad.value_or(0.0) +
                       std::abs(now.head->pan_rad - before.head->pan_rad) +
                       std::abs(now.head->tilt_rad - before.head->tilt_rad);
  }
  row.collisions = std::ssize(episode.contacts);
  if (episode.scene && !episode.poses.empty()) {
    row.min_true_clearance_m = episode.truth.min_clearance_m;
    row.nearest_link = episode.truth.nearest_link;
    row.nearest_object = episode.truth.nearest_object;
    row.nearest_s = episode.truth.nearest_s;
  }
  if (episode.following) static_cast<MapFollowing&>(row) = *episode.following;
  return row;
}

void add_event(const EventRow& event, EpisodeRow& episode) {
  using Kind = ReplannerEvent::Kind;
  episode.replans += event.kind == Kind::kReplanned;
  episode.stops += event.kind == Kind::kStopped;
  episode.slowdowns += event.kind == Kind::kSlowed;
  const bool is_followed = event.kind == Kind::kReplanned || event.kind == Kind::kPlanned;
  if (is_followed || (event.kind == Kind::kReplanFailed && event.solve_ms > 0.0)) {
    episode.search_ms.push_back(event.solve_ms);
  }
  if (!is_followed) return;
  episode.splice_velocity_jump_max =
      std::max(episode.splice_velocity_jump_max, event.splice_velocity_jump);
  episode.solve_ms.push_back(event.solve_ms);
  episode.unknown_share.push_back(event.unknown_share);
  const auto add = [](const std::optional<double>& value, std::vector<double>& values) {
    if (value) values.push_back(*value);
  };
  add(event.map_age_ms, episode.map_age_ms);
  add(event.stamp_to_trajectory_ms, episode.stamp_to_trajectory_ms);
  add(event.frame_to_trajectory_ms, episode.frame_to_trajectory_ms);
}

}  // namespace

std::string cause_of(const TrueContact& contact, const EpisodeRecord& episode, double rest_speed) {
  if (contact.is_own) return "its own link";
  if (speed_at(episode.poses, contact.begin_s) < rest_speed) return "walked into while stopped";
  if (episode.views.empty() || episode.scene == nullptr) return "unknown";
  const auto& objects = episode.scene->objects();
  const auto named = std::ranges::find(objects, contact.object, &SceneObject::name);
  if (named == objects.end()) return "unknown";
  RayCaster caster(*episode.scene);
  int seen = 0;
  for (const CameraView& view : episode.views) {
    if (view.stamp_s < contact.begin_s - kSeenFor_s || view.stamp_s > contact.begin_s) continue;
    caster.set_time(view.stamp_s);
    if (!shows(view, caster, static_cast<int>(named - objects.begin()))) return "unseen";
    ++seen;
  }
  return seen == 0 ? "unseen" : "fault";
}

std::vector<Eigen::Vector2d> outline_from_above(const Shape& shape,
                                                const Transform& T_world_shape) {
  std::vector<Eigen::Vector2d> points;
  for (const Eigen::Vector3d& vertex : triangulate(shape, kRound).vertices_m) {
    points.emplace_back((T_world_shape * vertex).head<2>());
  }
  return convex_hull(std::move(points));
}

void record_replan_head(const ReplanHead& head, Recorder& recorder) {
  record_run_head(head, kRunSeries, recorder);
  stored_head().record(head, kRunSeries, 0, recorder);
}

void record_episode(const EpisodeRecord& episode, const RobotModel& robot, int pictures,
                    Recorder& recorder) {
  const std::int64_t number = episode.episode;
  stored_episode().record(row_of(episode), "episode", number, recorder);
  recorder.add_filled("episode", number, "mapping", mapping_array(episode.mapping));
  recorder.add_filled("episode", number, "motion", motion_array(episode.poses));
  recorder.add_filled("episode", number, "course", course_of(episode, robot));
  const auto record_all = [&](const auto& parts, const auto& stored, std::string_view series) {
    std::int64_t item = number * 100'000;
    for (const auto& part : parts) stored.record({part, number}, series, item++, recorder);
  };
  record_all(episode.events, stored_event(), "event");
  record_all(episode.contacts, stored_contact(), "contact");
  record_all(episode.guesses, stored_guess(), "guess");
  if (pictures > 0) record_pictures(episode, robot, pictures, recorder);
}

Result<StoredRow<EventRow>::Rows> read_events(ResultsReader& reader, std::int64_t episode) {
  auto events = SIDESTEP_TRY(stored_event().read_all(reader, "event", kFile));
  std::erase_if(events, [&](const auto& event) { return event.second.episode != episode; });
  return events;
}

Result<ReplanRows> read_replan_rows(const std::filesystem::path& path) {
  auto reader = SIDESTEP_TRY(ResultsReader::open(path));
  const std::string file = path.string();
  ReplanRows rows;
  rows.head = SIDESTEP_TRY(stored_head().read(*reader, kRunSeries, 0, file));
  static_cast<DividedRun&>(rows.head) = SIDESTEP_TRY(read_run_head(*reader, kRunSeries, file));
  auto episodes = SIDESTEP_TRY(stored_episode().read_all(*reader, "episode", file));
  const auto events = SIDESTEP_TRY(stored_event().read_all(*reader, "event", file));
  const auto contacts = SIDESTEP_TRY(stored_contact().read_all(*reader, "contact", file));
  const auto guesses = SIDESTEP_TRY(stored_guess().read_all(*reader, "guess", file));
  for (auto& [number, episode] : episodes) {
    episode.episode = number;
    rows.episodes.push_back(std::move(episode));
  }
  for (const auto& [item, event] : events) {
    const auto its = std::ranges::find(rows.episodes, event.episode, &EpisodeRow::episode);
    if (its != rows.episodes.end()) add_event(event, *its);
  }
  for (const auto& [item, contact] : contacts) {
    rows.contacts.push_back(contact);
    const auto its = std::ranges::find(rows.episodes, contact.episode, &EpisodeRow::episode);
    if (its != rows.episodes.end()) its->own_collisions += contact.is_by_robot() ? 1 : 0;
  }
  for (const auto& [item, guess] : guesses) {
    auto known = std::ranges::find(rows.guesses, guess.guess, &Replanner::GuessCount::guess);
    if (known == rows.guesses.end()) known = rows.guesses.insert(known, {guess.guess, 0, 0});
    known->tried += guess.tried;
    known->led += guess.led;
  }
  return rows;
}

}  // namespace sidestep
