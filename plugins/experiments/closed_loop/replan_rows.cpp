#include "replan_rows.hpp"

#include <algorithm>

#include "replan_pictures.hpp"

namespace sidestep {
namespace {

constexpr std::size_t kPathEvery = 5;  ///< True states, of 125 Hz.

constexpr const char* kFile = "results.sqlite";

const StoredRow<EventRow>& stored_event() {
  using E = EventRow;
  static const auto kEvent =
      StoredRow<E>()
          .add("episode", &E::episode)
          .add("kind", &E::kind)
          .add_derived("kind_name", [](const E& event) { return to_string(event.kind); })
          .add("time_s", &E::time_s)
          .add_derived("cause", &E::cause)
          .add("solve_ms", &E::solve_ms)
          .add_derived("reason", &E::reason)
          .add_derived("guess", &E::guess)
          .add("attempts", &E::attempts)
          .add("cost", &E::cost)
          .add("splice_velocity_jump", &E::splice_velocity_jump)
          .add("takeover_s", &E::takeover_s)
          .add("map_stamp_s", &E::map_stamp_s)
          .add("unknown_share", &E::unknown_share)
          .add("map_age_ms", &E::map_age_ms)
          .add("stamp_to_trajectory_ms", &E::stamp_to_trajectory_ms)
          .add("frame_to_trajectory_ms", &E::frame_to_trajectory_ms);
  return kEvent;
}

EventRow row_of(const EpisodeEvent& event, std::int64_t episode) {
  const ReplannerEvent& its = event.event;
  return {episode,
          its.kind,
          its.stamp.seconds(),
          its.solve_ms,
          its.attempts,
          its.cost,
          its.splice_velocity_jump,
          its.takeover.seconds(),
          its.map_stamp.seconds(),
          its.unknown_share,
          event.map_age_ms,
          event.stamp_to_trajectory_ms,
          event.frame_to_trajectory_ms,
          its.cause,
          std::string(to_string(its.reason)),
          its.guess};
}

const StoredRow<ContactRow>& stored_contact() {
  using C = ContactRow;
  static const auto kContact = StoredRow<C>()
                                   .add("episode", &C::episode)
                                   .add("link", &C::link)
                                   .add("object", &C::object)
                                   .add("begin_s", &C::time_s)
                                   .add("end_s", &C::end_s)
                                   .add("depth_m", &C::depth_m)
                                   .add("cause", &C::cause);
  return kContact;
}

struct GuessRow : Replanner::GuessCount {
  std::int64_t episode = 0;
};

const StoredRow<GuessRow>& stored_guess() {
  static const auto kGuess = StoredRow<GuessRow>()
                                 .add("episode", &GuessRow::episode)
                                 .add("name", &GuessRow::guess)
                                 .add("tried", &GuessRow::tried)
                                 .add("led", &GuessRow::led);
  return kGuess;
}

const StoredRow<EpisodeRow>& stored_episode() {
  using E = EpisodeRow;
  static const auto kEpisode = StoredRow<E>()
                                   .add("success", &E::success)
                                   .add("reached", &E::reached)
                                   .add("reason", &E::reason)
                                   .add("begin_s", &E::begin_s)
                                   .add("duration_s", &E::duration_s)
                                   .add("path_length", &E::path_length)
                                   .add("collisions", &E::collisions)
                                   .add("steps", &E::steps)
                                   .add("checks", &E::checks)
                                   .add("frames", &E::frames)
                                   .add("frames_dropped", &E::frames_dropped)
                                   .add("min_true_clearance_m", &E::min_true_clearance_m)
                                   .add("nearest_link", &E::nearest_link)
                                   .add("nearest_object", &E::nearest_object)
                                   .add("nearest_s", &E::nearest_s)
                                   .add("appear_frames", &E::appear_frames)
                                   .add("clear_frames", &E::clear_frames)
                                   .add("ghost_vox", &E::ghost_vox);
  return kEpisode;
}

StoredArray mapping_array(const std::vector<MappedFrame>& frames) {
  StoredArray array{static_cast<int>(frames.size()), 5, {}};
  for (const MappedFrame& frame : frames) {
    for (const double value :
         {frame.stamp_s, frame.received_s, frame.published_s, frame.integrate_ms, frame.field_ms}) {
      array.values.push_back(static_cast<float>(value));
    }
  }
  return array;
}

/// Time, then every joint.
StoredArray motion_array(const std::vector<TruePose>& poses) {
  StoredArray array;
  for (std::size_t i = 0; i < poses.size(); i += kPathEvery) {
    array.values.push_back(static_cast<float>(poses[i].time_s));
    for (const double q : poses[i].q) array.values.push_back(static_cast<float>(q));
    array.columns = static_cast<int>(poses[i].q.size()) + 1;
    ++array.rows;
  }
  return array;
}

double path_length(const std::vector<TruePose>& poses) {
  double length = 0.0;
  for (std::size_t i = 1; i < poses.size(); ++i) length += (poses[i].q - poses[i - 1].q).norm();
  return length;
}

EpisodeRow row_of(const EpisodeRecord& episode) {
  EpisodeRow row;
  row.success = episode.success();
  row.reached = episode.reached;
  row.reason = episode.reason;
  row.begin_s = episode.begin_s;
  row.duration_s = episode.duration_s;
  if (!episode.poses.empty()) row.path_length = path_length(episode.poses);
  row.collisions = std::ssize(episode.contacts);
  row.steps = episode.steps;
  row.checks = episode.checks;
  row.frames = episode.frames;
  row.frames_dropped = episode.frames_dropped;
  if (episode.scene && !episode.poses.empty()) {
    row.min_true_clearance_m = episode.truth.min_clearance_m;
    row.nearest_link = episode.truth.nearest_link;
    row.nearest_object = episode.truth.nearest_object;
    row.nearest_s = episode.truth.nearest_s;
  }
  if (episode.following) {
    row.appear_frames = episode.following->appear_frames;
    row.clear_frames = episode.following->clear_frames;
    row.ghost_vox = episode.following->ghost_vox;
  }
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

void record_replan_run(const std::string& identity, Recorder& recorder) {
  recorder.add("run", 0, "identity", identity);
}

void record_episode(const EpisodeRecord& episode, const RobotModel& robot, int pictures,
                    Recorder& recorder) {
  const std::int64_t number = episode.episode;
  stored_episode().record(row_of(episode), "episode", number, recorder);
  recorder.add_filled("episode", number, "mapping", mapping_array(episode.mapping));
  recorder.add_filled("episode", number, "motion", motion_array(episode.poses));
  std::int64_t item = first_item_of(number);
  for (const EpisodeEvent& event : episode.events) {
    stored_event().record(row_of(event, number), "event", item++, recorder);
  }
  item = first_item_of(number);
  for (const auto& [contact, cause] : episode.contacts) {
    stored_contact().record({number, contact.begin_s, contact.end_s, contact.depth_m, contact.link,
                             contact.object, cause},
                            "contact", item++, recorder);
  }
  item = first_item_of(number);
  for (const Replanner::GuessCount& guess : episode.guesses) {
    stored_guess().record({guess, number}, "guess", item++, recorder);
  }
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
  auto identity = SIDESTEP_TRY(reader->text("run", 0, "identity"));
  if (!identity) return fail(ErrorCode::kIo, "holds no replan experiment", file);
  rows.identity = std::move(*identity);
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
  for (const auto& [item, contact] : contacts) rows.contacts.push_back(contact);
  for (const auto& [item, guess] : guesses) {
    auto known = std::ranges::find(rows.guesses, guess.guess, &Replanner::GuessCount::guess);
    if (known == rows.guesses.end()) known = rows.guesses.insert(known, {guess.guess, 0, 0});
    known->tried += guess.tried;
    known->led += guess.led;
  }
  return rows;
}

}  // namespace sidestep
