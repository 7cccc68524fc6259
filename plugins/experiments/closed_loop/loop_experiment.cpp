#include "closed_loop.hpp"

#include <algorithm>
#include <iterator>

#include <sidestep/core/index.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/divided_run.hpp>
#include <sidestep/results/statistics.hpp>
#include <sidestep/results/summary.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/planning_settings.hpp>

namespace sidestep {
namespace {

using report::at;
using report::cell;
using Json = nlohmann::ordered_json;

constexpr std::size_t kTableRows = 40;

template <class Member>
auto sum_of(const std::vector<EpisodeRow>& episodes, Member member) {
  auto sum = std::decay_t<decltype(episodes.front().*member)>{};
  for (const EpisodeRow& episode : episodes) sum += episode.*member;
  return sum;
}

/// The episode with the least true clearance; null where it is known of none.
const EpisodeRow* closest_of(const std::vector<EpisodeRow>& episodes) {
  const auto closest = std::ranges::min_element(episodes, {}, [](const EpisodeRow& episode) {
    return episode.min_true_clearance_m.value_or(kInfinity);
  });
  return closest != episodes.end() && closest->min_true_clearance_m ? &*closest : nullptr;
}

/// What came nearest to what, there.
Json nearest_json(const EpisodeRow* closest) {
  if (closest == nullptr || closest->nearest_link.value_or("").empty()) return nullptr;
  return {{"episode", closest->episode},
          {"link", *closest->nearest_link},
          {"object", closest->nearest_object.value_or("")}};
}

/// Over the episodes in which it was measured: `count(episode)`, which may be nothing.
template <class Count>
std::optional<std::int64_t> measured_total(const ReplanRows& rows, Count count) {
  std::optional<std::int64_t> sum;
  for (const EpisodeRow& episode : rows.episodes) {
    const std::optional<std::int64_t> its = std::invoke(count, episode);
    if (its) sum = sum.value_or(0) + *its;
  }
  return sum;
}
template <class Count>
auto sum_measured(Count count) {
  return [count](const ReplanRows& rows) {
    const auto sum = measured_total(rows, count);
    return sum ? Json(*sum) : Json(nullptr);
  };
}
/// Of all that was counted.
template <class Part, class All>
auto share_measured(Part part, All all) {
  return [part, all](const ReplanRows& rows) -> Json {
    const auto whole = measured_total(rows, all);
    if (whole.value_or(0) == 0) return nullptr;
    return static_cast<double>(measured_total(rows, part).value_or(0)) /
           static_cast<double>(*whole);
  };
}

/// Something of an episode's tracks; nothing, or nothing in it, where they were not measured.
auto of_tracks(std::int64_t TrackRecord::*part) {
  return [part](const EpisodeRow& episode) {
    return episode.tracks ? std::optional((*episode.tracks).*part) : std::nullopt;
  };
}
auto of_tracks(std::vector<double> TrackRecord::*part) {
  return [part](const EpisodeRow& episode) {
    return episode.tracks ? (*episode.tracks).*part : std::vector<double>();
  };
}

/// The values of every episode, one after the other.
template <class Values>
auto all_of(Values values_of) {
  return [values_of](const ReplanRows& rows) {
    std::vector<double> all;
    for (const EpisodeRow& episode : rows.episodes) {
      std::ranges::copy(std::invoke(values_of, episode), std::back_inserter(all));
    }
    return all;
  };
}

Json guesses_of(const ReplanRows& rows) {
  Json list = Json::array();
  for (const Replanner::GuessCount& guess : rows.guesses) {
    list.push_back({{"name", guess.guess}, {"tried", guess.tried}, {"led", guess.led}});
  }
  return list;
}

/// By joint.
Json limits_of(const MotionLimits& limits) {
  Json list = Json::object();
  for (std::size_t j = 0; j < limits.names.size(); ++j) {
    list[limits.names[j]] = {{"velocity", limits.velocity[j]},
                             {"acceleration", limits.acceleration[j]},
                             {"braking", limits.while_stopping()[j]}};
  }
  return list;
}

/// Of every episode that reached its goal, as far as it is known.
template <class Value>
auto of_reached(Value value) {
  return all_of([value](const EpisodeRow& episode) -> std::vector<double> {
    const std::optional<double> its = std::invoke(value, episode);
    if (!episode.reached || !its) return {};
    return {*its};
  });
}

std::optional<double> free_run_ratio(const EpisodeRow& episode) {
  if (!episode.free_run_s) return {};
  return episode.duration_s / *episode.free_run_s;
}

/// How often a second something happened; null where no time passed.
template <class Member>
auto rate_of(Member member) {
  return [member](const ReplanRows& rows) {
    const double time_s = sum_of(rows.episodes, &EpisodeRow::duration_s);
    return time_s > 0.0 ? Json(static_cast<double>(sum_of(rows.episodes, member)) / time_s)
                        : Json();
  };
}

Json collisions_of(const ReplanRows& rows) {
  Json list = Json::array();
  for (const ContactRow& contact : rows.contacts) {
    list.push_back({{"episode", contact.episode},
                    {"time_s", contact.begin_s},
                    {"link", contact.link},
                    {"object", contact.object},
                    {"depth_m", contact.depth_m},
                    {"by", contact.is_by_robot() ? "robot" : "other"},
                    {"cause", contact.cause}});
  }
  return list;
}

Json failures_of(const ReplanRows& rows) {
  Json list = Json::array();
  for (const EpisodeRow& episode : rows.episodes) {
    if (episode.success) continue;
    Json failure = {{"episode", episode.episode}, {"reason", episode.reason}};
    if (!rows.head.again.empty()) {
      failure["again"] = rows.head.again +
                         " --set experiment.first_episode=" + std::to_string(episode.episode) +
                         " --set experiment.episodes=1";
    }
    list.push_back(std::move(failure));
  }
  return list;
}

/// The overrides that a configuration was read with, as they were written.
void find_overrides(const Node& node, std::vector<std::string>& overrides) {
  const std::string& origin = node.mark().file;
  if (origin.starts_with("--set ") && std::ranges::find(overrides, origin) == overrides.end()) {
    overrides.push_back(origin);
  }
  for (const Node& item : node.items()) find_overrides(item, overrides);
  for (const Node::Entry& entry : node.entries()) find_overrides(entry.value, overrides);
}

/// The command that runs a configuration again, overrides included.
std::string command_again(const Configuration& configuration) {
  std::vector<std::string> overrides;
  find_overrides(configuration.root, overrides);
  std::string command = "sidestep run " + configuration.file.string();
  for (const std::string& override : overrides) {
    command += " --set '" + override.substr(std::string("--set ").size()) + "'";
  }
  return command;
}

std::string table_text(const ReplanRows& rows) {
  TextTable table({"episode", "result", "time", "clearance", "collisions", "replans", "stops",
                   "solve p50", "stamp to plan p95", "frames", "dropped"});
  const std::size_t shown = std::min(rows.episodes.size(), kTableRows);
  for (std::size_t i = 0; i < shown; ++i) {
    const EpisodeRow& r = rows.episodes[i];
    table.add({std::to_string(r.episode), r.success ? "success" : "failed",
               format("%.2f s", r.duration_s),
               r.min_true_clearance_m ? format("%.3f m", *r.min_true_clearance_m) : "-",
               std::to_string(r.collisions), std::to_string(r.replans), std::to_string(r.stops),
               cell(quantile_json(r.solve_ms, 0.5), "%.2f ms"),
               cell(quantile_json(r.stamp_to_trajectory_ms, 0.95), "%.1f ms"),
               std::to_string(r.frames), std::to_string(r.frames_dropped)});
  }
  std::string text = table.text();
  if (shown < rows.episodes.size()) {
    text += "and " + std::to_string(rows.episodes.size() - shown) + " more in results.sqlite\n";
  }
  return text;
}

/// Of the run's episodes, those that are planned in its shard; 0: as many as there are.
std::int64_t planned_episodes(const ReplanHead& head) {
  const Shard& shard = head.shard;
  return (head.episodes + shard.count - 1 - shard.index) / shard.count;
}

std::string verdict_text(const ReplanRows& rows, const LoopEnd& end, const Json& metrics) {
  const auto done = rows.episodes.size();
  const auto successes = std::ranges::count(rows.episodes, true, &EpisodeRow::success);
  std::string count = std::to_string(successes) + " of " + std::to_string(done) +
                      (done == 1 ? " episode" : " episodes") +
                      " reached the goal without touching anything";
  const Json& by_others = at(metrics, "/contacts_by_others");
  if (by_others.is_number() && by_others != 0)
    count += ", walked into " + cell(by_others) + " times";
  if (end.fault) return "Ended early: " + end.fault->describe();
  const std::int64_t all = planned_episodes(rows.head);
  if (end.interrupted) {
    const std::string planned = all > 0 ? " of " + std::to_string(all) : "";
    return "Interrupted after " + std::to_string(done) + planned + " episodes: " + count +
           "; they are saved.";
  }
  const bool lacks_some = std::ssize(rows.episodes) < all;
  std::string text =
      (static_cast<std::size_t>(successes) == done && !lacks_some ? "Success: " : "Failed: ") +
      (lacks_some
           ? "of " + std::to_string(all) + " episodes, only " + std::to_string(done) + " were run: "
           : "") +
      count + "; " + cell(at(metrics, "/replans")) + " replans, " + cell(at(metrics, "/stops")) +
      " stops, least true clearance " + cell(at(metrics, "/min_true_clearance_m"), "%.3f m");
  if (at(metrics, "/nearest").is_object()) {
    text += ", of " + cell(at(metrics, "/nearest/link")) + " to " +
            cell(at(metrics, "/nearest/object"));
  }
  text += ".";
  const auto failed = std::ranges::find(rows.episodes, false, &EpisodeRow::success);
  if (failed != rows.episodes.end()) {
    text += " Episode " + std::to_string(failed->episode) + ": " + failed->reason + ".";
  }
  return text;
}

}  // namespace

const report::ResultColumnsOf<ReplanRows>& replan_metrics() {
  using E = EpisodeRow;
  using T = TrackRecord;
  using report::Shown;
  const auto sum = [](auto member) {
    return [member](const ReplanRows& rows) { return sum_of(rows.episodes, member); };
  };
  const std::vector<std::string> spread = {"p50", "p95", "max"};
  const std::vector<std::string> with_mean = {"p50", "p95", "max", "mean"};
  const std::vector<std::string> error = {"mean", "p95", "max"};
  const auto p95 = [](const char* heading, const char* pattern) {
    return Shown{.heading = heading, .pattern = pattern, .statistics = "p95"};
  };
  const auto measured = [](const char* heading, const char* pattern, const char* statistics = "") {
    return Shown{heading, pattern, false, false, statistics, true};
  };
  static const auto kMetrics =
      report::ResultColumnsOf<ReplanRows>(report::kWholeSummary)
          .table("Outcome")
          .add("episodes", [](const ReplanRows& rows) { return rows.episodes.size(); },
               "Episodes that were run.", {.heading = "episodes", .compared = true})
          .add("success_share",
               [](const ReplanRows& rows) { return share_of(rows.episodes, &E::success); },
               "Share that reached the goal and touched nothing by the robot's own motion.",
               {.heading = "success", .pattern = report::kPercent, .compared = true})
          .add("collisions_true", sum(&E::collisions), "Collisions with the true scene.",
               {.heading = "true collisions", .compared = true})
          .add("contacts_by_robot", sum(&E::own_collisions),
               "Of these, those in which the robot moved towards what it touched.",
               {.heading = "by the robot", .compared = true})
          .add(
              "contacts_by_others",
              [](const ReplanRows& rows) {
                return sum_of(rows.episodes, &E::collisions) -
                       sum_of(rows.episodes, &E::own_collisions);
              },
              "The rest: somebody walked into it.")
          .add("min_true_clearance_m",
               [](const ReplanRows& rows) {
                 const E* closest = closest_of(rows.episodes);
                 return closest != nullptr ? Json(*closest->min_true_clearance_m) : Json();
               },
               "Least clearance to the true scene [m].",
               {.heading = "least true clearance", .pattern = "%.3f m", .compared = true})
          .add(
              "nearest",
              [](const ReplanRows& rows) { return nearest_json(closest_of(rows.episodes)); },
              "In which episode, of which link and to which object.")
          .spread("time_to_goal_s.", of_reached(&E::duration_s),
                  "Time until the goal was reached [s].", with_mean,
                  {.heading = "time to goal",
                   .pattern = "%.2f s",
                   .compared = true,
                   .statistics = "p50"})
          .spread("free_run_ratio.", of_reached(&free_run_ratio),
                  "That time over the time without people, where that was run.", spread,
                  {.heading = "over free run",
                   .pattern = "%.2f",
                   .compared = true,
                   .statistics = "p50",
                   .only_measured = true})
          .spread("path_length.", of_reached(&E::path_length),
                  "Way in the space of joints [m, rad] of episodes that reached the goal.", spread)
          .spread("goal_error_m.", of_reached(&E::goal_error_m),
                  "How far the base truly stands from its goal then [m].", spread)
          .spread("head_way_rad.", of_reached(&E::head_way_rad),
                  "Way of the head's pan and tilt together until then [rad].", spread)
          .add("seen_share", share_measured(&E::seen_vox, &E::entered_vox),
               "Share of the voxels that the robot entered that a frame had seen before.",
               measured("seen before", report::kPercent))
          .add("certified_share", share_measured(&E::proven_motions, &E::motions),
               "Share of the motions that were followed that is proven to be clear of what the map "
               "held as they began, with certificates in the run's folder `certificates`; null "
               "where none were asked for.",
               measured("certified", report::kPercent))
          .add(
              "broken_policies", sum_measured(&E::broken_policies),
              "Promises of docs/closed_loop.md that an episode broke, summed over them; null where "
              "`experiment.policies` asked for none to be looked at.",
              measured("broken policies", "%g"))
          .add("replans", sum(&E::replans), "Trajectories replaced on the way.",
               {.heading = "replans", .compared = true})
          .add("guesses", &guesses_of, "First guesses: how often tried, and how often one led.")
          .add("stops", sum(&E::stops), "Times that the robot was stopped.",
               {.heading = "stops", .compared = true})
          .add("slowdowns", sum(&E::slowdowns), "Times that it braked for what moved nearby.")
          .add("splice_velocity_jump_max",
               [](const ReplanRows& rows) {
                 return percentile(values_of(rows.episodes, &E::splice_velocity_jump_max), 1.0);
               },
               "Largest velocity jump of a joint where a trajectory took over [m/s, rad/s].",
               {.heading = "largest velocity jump", .pattern = "%.2g"})
          .table("Times")
          .spread(
              "solve_ms.", all_of(&E::solve_ms), "Wall time of a search that led to a trajectory.",
              spread,
              {.heading = "solve", .pattern = "%.2f ms", .compared = true, .statistics = "p50 p95"})
          .spread("search_ms.", all_of(&E::search_ms), "Wall time of every search.", spread,
                  p95("all searches", "%.2f ms"))
          .spread("stamp_to_trajectory_ms.", all_of(&E::stamp_to_trajectory_ms),
                  "From a depth image's stamp to the trajectory that it led to.", spread,
                  {.heading = "stamp to trajectory", .pattern = "%.1f ms", .compared = true})
          .spread("frame_to_trajectory_ms.", all_of(&E::frame_to_trajectory_ms),
                  "The same from when the source handed the image over.", spread)
          .spread("map_age_ms.", all_of(&E::map_age_ms), "Age of the map that a search began with.",
                  spread, p95("age of the map", "%.1f ms"))
          .spread("unknown_share.", all_of(&E::unknown_share),
                  "Share of a trajectory's checks in space that no frame had seen.", spread)
          .add("step_hz", rate_of(&E::steps), "Control steps a second.",
               {.heading = "steps", .pattern = "%.0f Hz"})
          .add("check_hz", rate_of(&E::checks),
               "Checks of what is followed that were computed a second: one for each new map and "
               "trajectory.",
               {.heading = "checks", .pattern = "%.1f Hz"})
          .add("frames", sum(&E::frames), "Frames that were mapped.", {.heading = "frames"})
          .add("frames_dropped", sum(&E::frames_dropped), "Frames that were not.",
               {.heading = "dropped"})
          .spread("appear_frames.", all_of(&E::appear_frames),
                  "Frames from an object's entry into view until it was in the map.", spread)
          .spread("clear_frames.", all_of(&E::clear_frames),
                  "Frames that saw through a voxel until it was free again.", spread)
          .add("ghost_vox", sum_measured(&E::ghost_vox),
               "Voxels that an object left and that stayed occupied.")
          .table("Tracks")
          .add("tracks.found_share",
               share_measured(of_tracks(&T::found_frames), of_tracks(&T::due_frames)),
               "Share of the frames that show a person-sized object, a second after it began to "
               "move in view or later, in which it is tracked.",
               measured("found", report::kPercent))
          .spread("tracks.delay_s.", all_of(of_tracks(&T::delay_s)),
                  "From when an object is in view and moves until it is tracked [s].", spread,
                  measured("delay", "%.2f s", "p50 p95"))
          .add("tracks.switches", sum_measured(of_tracks(&T::switches)),
               "Changes of an object's id while it was in view.", measured("switches", "%g"))
          .add("tracks.false", sum_measured(of_tracks(&T::false_tracks)),
               "Tracks that never were within 0.5 m of an object that moves.",
               measured("false", "%g"))
          .spread("tracks.position_error_m.", all_of(of_tracks(&T::position_error_m)),
                  "Distance of a track from the axis of its object, while in view [m].", error,
                  measured("position error", "%.3f m", "mean p95"))
          .spread("tracks.velocity_error_mps.", all_of(of_tracks(&T::velocity_error_mps)),
                  "The same of its velocity [m/s].", error,
                  measured("velocity error", "%.3f m/s", "mean p95"));
  return kMetrics;
}

ExperimentOutcome summarise_replan(const std::string& experiment, const ReplanRows& rows,
                                   const LoopEnd& end) {
  const Json metrics = replan_metrics().row(rows);
  const Shard& shard = rows.head.shard;
  const std::int64_t all = planned_episodes(rows.head);
  const bool all_done = rows.head.episodes == 0 || std::ssize(rows.episodes) == all;
  ExperimentOutcome outcome;
  outcome.interrupted = end.interrupted;
  outcome.fault = end.fault;
  outcome.success = all_done && !end.fault && !end.interrupted &&
                    std::ranges::all_of(rows.episodes, &EpisodeRow::success);
  outcome.verdict = (shard.is_whole() ? "" : "Shard " + shard_name(shard) + ": ") +
                    verdict_text(rows, end, metrics);
  outcome.table = table_text(rows);
  Json particulars = Json::parse(rows.head.about, nullptr, false);
  particulars.update(metrics);
  particulars["collisions"] = collisions_of(rows);
  particulars["failures"] = failures_of(rows);
  if (!shard.is_whole()) {
    particulars["shard"] = {{"index", shard.index + 1}, {"count", shard.count}};
  }
  outcome.summary_json = summary_text(rows.head.provenance, experiment, outcome, particulars);
  return outcome;
}

ExperimentFacts LoopExperiment::facts() const {
  // A replan's first guesses are `replanner.escalation`, and what it finds is timed anew always.
  // The robot looks on while it moves.
  return {.blocks = {"robot", "source", "mapper", "field", "optimiser", "planning", "executor",
                     "replanner"},
          .optional_blocks = {"check", "sampler", "predictor", "gaze", "localiser", "sources"},
          .unused_of_planning = {"max_unknown_share", "retime", "attempts"}};
}

void check_loop_names(const Configuration& configuration, const RobotDescription& robot,
                      std::vector<Error>& errors) {
  check_allowed_contacts(block_of(configuration, "check"), robot, nullptr, errors);
  check_floor(block_of(configuration, "planning"), robot, errors);
}

ReplanHead replan_head(const ExperimentContext& context, const ReplanConfiguration& settings,
                       const RobotDescription& robot, const std::string& identity) {
  ReplanHead head;
  static_cast<DividedRun&>(head) = {identity, provenance_of(context), context.shard, {}};
  head.about =
      Json{{"clock", settings.experiment.clock},
           {"robot", robot.name},
           {"limits", limits_of(settings.planning.limits(robot))},
           {"optimiser", block_of(context.configuration, "optimiser").find("plugin")->text()}}
          .dump();
  if (!identity.empty()) head.again = command_again(context.configuration);
  return head;
}

Result<ExperimentOutcome> run_loop(const ExperimentContext& context, const std::string& experiment,
                                   const ReplanHead& head,
                                   const std::function<Result<void>(Recorder& recorder)>& work) {
  auto store = SIDESTEP_TRY(open_store(context, head.provenance));
  Recorder recorder(*store);
  record_replan_head(head, recorder);  // Of one that is gone on with, there may be more episodes.
  SIDESTEP_TRY(recorder.commit());
  // Held here, so that episodes before one that cannot be run are kept.
  auto done = catch_all("the closed loop", [&] { return work(recorder); });
  store.reset();
  LoopEnd end;
  // One without end is ended by a stop, and not interrupted.
  end.interrupted = context.stop.stop_requested() && head.episodes > 0;
  const auto rows = SIDESTEP_TRY(read_replan_rows(context.out / "results.sqlite"));
  if (!done && rows.episodes.empty()) return error_of(done);
  if (!done) end.fault = std::move(done.error());
  return summarise_replan(experiment, rows, end);
}

}  // namespace sidestep
