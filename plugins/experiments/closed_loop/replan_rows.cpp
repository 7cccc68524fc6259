#include "replan_rows.hpp"

#include <algorithm>
#include <map>

#include "replan_pictures.hpp"

namespace sidestep {
namespace {

constexpr std::size_t kPathEvery = 5;  ///< True states, of 125 Hz.

void record_event(const EpisodeEvent& event, std::int64_t episode, std::int64_t item,
                  Recorder& recorder) {
  const ReplannerEvent& its = event.event;
  recorder.add("event", item, "episode", episode);
  recorder.add("event", item, "kind", static_cast<int>(its.kind));
  recorder.add("event", item, "kind_name", to_string(its.kind));
  recorder.add("event", item, "time_s", its.stamp.seconds());
  recorder.add("event", item, "cause", its.cause);
  recorder.add("event", item, "solve_ms", its.solve_ms);
  recorder.add("event", item, "reason", to_string(its.reason));
  recorder.add("event", item, "guess", its.guess);
  recorder.add("event", item, "attempts", its.attempts);
  recorder.add("event", item, "cost", its.cost);
  recorder.add("event", item, "splice_velocity_jump", its.splice_velocity_jump);
  recorder.add("event", item, "takeover_s", its.takeover.seconds());
  recorder.add("event", item, "map_stamp_s", its.map_stamp.seconds());
  recorder.add("event", item, "unknown_share", its.unknown_share);
  if (event.map_age_ms) recorder.add("event", item, "map_age_ms", *event.map_age_ms);
  if (event.stamp_to_trajectory_ms) {
    recorder.add("event", item, "stamp_to_trajectory_ms", *event.stamp_to_trajectory_ms);
  }
  if (event.frame_to_trajectory_ms) {
    recorder.add("event", item, "frame_to_trajectory_ms", *event.frame_to_trajectory_ms);
  }
}

void record_contact(const EpisodeContact& contact, std::int64_t episode, std::int64_t item,
                    Recorder& recorder) {
  recorder.add("contact", item, "episode", episode);
  recorder.add("contact", item, "link", contact.contact.link);
  recorder.add("contact", item, "object", contact.contact.object);
  recorder.add("contact", item, "begin_s", contact.contact.begin_s);
  recorder.add("contact", item, "end_s", contact.contact.end_s);
  recorder.add("contact", item, "depth_m", contact.contact.depth_m);
  recorder.add("contact", item, "cause", contact.cause);
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

StoredArray list_array(const std::vector<double>& values) {
  return {static_cast<int>(values.size()), 1, {values.begin(), values.end()}};
}

std::vector<double> list_of(ResultsReader& reader, std::int64_t episode, std::string_view key) {
  const auto array = reader.array("episode", episode, key);
  if (!array || !*array) return {};
  return {(*array)->values.begin(), (*array)->values.end()};
}

/// The numbers of one series, item by item.
using Items = std::map<std::int64_t, std::map<std::string, double, std::less<>>>;

Result<Items> read_items(ResultsReader& reader, std::string_view series) {
  Items items;
  auto read = reader.visit(series, [&](std::int64_t item, std::string_view key, double value) {
    items[item].insert_or_assign(std::string(key), value);
  });
  if (!read) return error_of(read);
  return items;
}

std::optional<double> value_of(const Items::mapped_type& item, std::string_view key) {
  const auto found = item.find(key);
  return found == item.end() ? std::nullopt : std::optional<double>(found->second);
}

std::int64_t count_of(const Items::mapped_type& item, std::string_view key) {
  return static_cast<std::int64_t>(value_of(item, key).value_or(0.0));
}

std::string text_of(ResultsReader& reader, std::string_view series, std::int64_t item,
                    std::string_view key) {
  const auto text = reader.text(series, item, key);
  return text ? text->value_or("") : "";
}

void add_events(const Items& events, std::map<std::int64_t, EpisodeRow>& rows) {
  for (const auto& [item, event] : events) {
    const auto row = rows.find(count_of(event, "episode"));
    if (row == rows.end()) continue;
    EpisodeRow& episode = row->second;
    const auto kind = static_cast<ReplannerEvent::Kind>(count_of(event, "kind"));
    if (kind == ReplannerEvent::Kind::kReplanned) ++episode.replans;
    if (kind == ReplannerEvent::Kind::kStopped) ++episode.stops;
    if (kind == ReplannerEvent::Kind::kSlowed) ++episode.slowdowns;
    const bool is_followed =
        kind == ReplannerEvent::Kind::kReplanned || kind == ReplannerEvent::Kind::kPlanned;
    const double solve_ms = value_of(event, "solve_ms").value_or(0.0);
    if (is_followed || (kind == ReplannerEvent::Kind::kReplanFailed && solve_ms > 0.0)) {
      episode.search_ms.push_back(solve_ms);
    }
    if (!is_followed) continue;
    episode.splice_velocity_jump_max = std::max(
        episode.splice_velocity_jump_max, value_of(event, "splice_velocity_jump").value_or(0.0));
    episode.solve_ms.push_back(solve_ms);
    episode.unknown_share.push_back(value_of(event, "unknown_share").value_or(0.0));
    if (const auto age_ms = value_of(event, "map_age_ms")) episode.map_age_ms.push_back(*age_ms);
    if (const auto ms = value_of(event, "stamp_to_trajectory_ms")) {
      episode.stamp_to_trajectory_ms.push_back(*ms);
    }
    if (const auto ms = value_of(event, "frame_to_trajectory_ms")) {
      episode.frame_to_trajectory_ms.push_back(*ms);
    }
  }
}

}  // namespace

void record_replan_run(const std::string& identity, Recorder& recorder) {
  recorder.add("run", 0, "identity", identity);
}

void record_episode(const EpisodeRecord& episode, const RobotModel& robot, int pictures,
                    Recorder& recorder) {
  const std::int64_t item = episode.episode;
  recorder.add("episode", item, "success", episode.success());
  recorder.add("episode", item, "reached", episode.reached);
  recorder.add("episode", item, "reason", episode.reason);
  recorder.add("episode", item, "begin_s", episode.begin_s);
  recorder.add("episode", item, "duration_s", episode.duration_s);
  if (!episode.poses.empty()) {
    recorder.add("episode", item, "path_length", path_length(episode.poses));
  }
  recorder.add("episode", item, "collisions", episode.contacts.size());
  recorder.add("episode", item, "steps", episode.steps);
  recorder.add("episode", item, "checks", episode.checks);
  recorder.add("episode", item, "frames", episode.frames);
  recorder.add("episode", item, "frames_dropped", episode.frames_dropped);
  if (episode.scene && !episode.poses.empty()) {
    recorder.add("episode", item, "min_true_clearance_m", episode.truth.min_clearance_m);
    recorder.add("episode", item, "nearest_link", episode.truth.nearest_link);
    recorder.add("episode", item, "nearest_object", episode.truth.nearest_object);
    recorder.add("episode", item, "nearest_s", episode.truth.nearest_s);
  }
  if (episode.following) {
    recorder.add_filled("episode", item, "appear_frames",
                        list_array(episode.following->appear_frames));
    recorder.add_filled("episode", item, "clear_frames",
                        list_array(episode.following->clear_frames));
    recorder.add("episode", item, "ghost_vox", episode.following->ghost_vox);
  }
  recorder.add_filled("episode", item, "mapping", mapping_array(episode.mapping));
  recorder.add_filled("episode", item, "motion", motion_array(episode.poses));
  for (std::size_t i = 0; i < episode.events.size(); ++i) {
    record_event(episode.events[i], item, first_item_of(item) + static_cast<std::int64_t>(i),
                 recorder);
  }
  for (std::size_t i = 0; i < episode.contacts.size(); ++i) {
    record_contact(episode.contacts[i], item, first_item_of(item) + static_cast<std::int64_t>(i),
                   recorder);
  }
  for (std::size_t i = 0; i < episode.guesses.size(); ++i) {
    const std::int64_t its = first_item_of(item) + static_cast<std::int64_t>(i);
    recorder.add("guess", its, "episode", item);
    recorder.add("guess", its, "name", episode.guesses[i].guess);
    recorder.add("guess", its, "tried", episode.guesses[i].tried);
    recorder.add("guess", its, "led", episode.guesses[i].led);
  }
  if (pictures > 0) record_pictures(episode, robot, pictures, recorder);
}

Result<ReplanRows> read_replan_rows(const std::filesystem::path& file) {
  auto reader = ResultsReader::open(file);
  if (!reader) return error_of(reader);
  ReplanRows rows;
  auto identity = (*reader)->text("run", 0, "identity");
  if (!identity) return error_of(identity);
  if (!*identity) return fail(ErrorCode::kIo, "holds no replan experiment", file.string());
  rows.identity = std::move(**identity);
  const auto episodes = read_items(**reader, "episode");
  if (!episodes) return error_of(episodes);
  const auto events = read_items(**reader, "event");
  if (!events) return error_of(events);
  const auto contacts = read_items(**reader, "contact");
  if (!contacts) return error_of(contacts);
  const auto guesses = read_items(**reader, "guess");
  if (!guesses) return error_of(guesses);
  for (const auto& [item, values] : *guesses) {
    const std::string name = text_of(**reader, "guess", item, "name");
    auto known = std::ranges::find(rows.guesses, name, &Replanner::GuessCount::guess);
    if (known == rows.guesses.end()) known = rows.guesses.insert(known, {name, 0, 0});
    known->tried += count_of(values, "tried");
    known->led += count_of(values, "led");
  }
  std::map<std::int64_t, EpisodeRow> by_episode;
  for (const auto& [item, values] : *episodes) {
    EpisodeRow& row = by_episode[item];
    row.episode = item;
    row.success = count_of(values, "success") != 0;
    row.reached = count_of(values, "reached") != 0;
    row.duration_s = value_of(values, "duration_s").value_or(0.0);
    row.path_length = value_of(values, "path_length");
    row.min_true_clearance_m = value_of(values, "min_true_clearance_m");
    row.collisions = count_of(values, "collisions");
    row.steps = count_of(values, "steps");
    row.checks = count_of(values, "checks");
    row.frames = count_of(values, "frames");
    row.frames_dropped = count_of(values, "frames_dropped");
    row.appear_frames = list_of(**reader, item, "appear_frames");
    row.clear_frames = list_of(**reader, item, "clear_frames");
    if (values.contains("ghost_vox")) row.ghost_vox = count_of(values, "ghost_vox");
    row.nearest_link = text_of(**reader, "episode", item, "nearest_link");
    row.nearest_object = text_of(**reader, "episode", item, "nearest_object");
    row.reason = text_of(**reader, "episode", item, "reason");
  }
  add_events(*events, by_episode);
  for (auto& [item, row] : by_episode) rows.episodes.push_back(std::move(row));
  for (const auto& [item, values] : *contacts) {
    rows.contacts.push_back({count_of(values, "episode"), value_of(values, "begin_s").value_or(0.0),
                             value_of(values, "depth_m").value_or(0.0),
                             text_of(**reader, "contact", item, "link"),
                             text_of(**reader, "contact", item, "object"),
                             text_of(**reader, "contact", item, "cause")});
  }
  return rows;
}

}  // namespace sidestep
