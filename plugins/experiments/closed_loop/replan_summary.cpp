#include "replan_summary.hpp"

#include <algorithm>
#include <numeric>

#include <sidestep/report/report_parts.hpp>
#include <sidestep/report/text_table.hpp>
#include <sidestep/results/json.hpp>
#include <sidestep/results/run_provenance.hpp>
#include <sidestep/results/statistics.hpp>
#include <sidestep/runtime/configuration.hpp>

namespace sidestep {
namespace {

using report::at;
using report::cell;
using Json = nlohmann::ordered_json;

constexpr std::size_t kTableRows = 40;

template <class Member>
std::vector<double> joined(const std::vector<EpisodeRow>& episodes, Member member) {
  std::vector<double> values;
  for (const EpisodeRow& episode : episodes) {
    values.insert(values.end(), (episode.*member).begin(), (episode.*member).end());
  }
  return values;
}

template <class Member>
auto sum_of(const std::vector<EpisodeRow>& episodes, Member member) {
  auto sum = std::decay_t<decltype(episodes.front().*member)>{};
  for (const EpisodeRow& episode : episodes) sum += episode.*member;
  return sum;
}

Json quantile(const std::vector<double>& values, double share) {
  return values.empty() ? Json(nullptr) : Json(percentile(values, share));
}

Json spread(const std::vector<double>& values) {
  return {{"p50", quantile(values, 0.5)},
          {"p95", quantile(values, 0.95)},
          {"max", quantile(values, 1.0)}};
}

/// That of one kind of measurement over all episodes.
template <class Member>
Json spread_of(const std::vector<EpisodeRow>& episodes, Member member) {
  return spread(joined(episodes, member));
}

/// The episode with the least true clearance; null where it is known of none.
const EpisodeRow* closest_of(const std::vector<EpisodeRow>& episodes) {
  const EpisodeRow* closest = nullptr;
  for (const EpisodeRow& episode : episodes) {
    if (!episode.min_true_clearance_m) continue;
    const bool is_closer =
        closest == nullptr || *episode.min_true_clearance_m < *closest->min_true_clearance_m;
    if (is_closer) closest = &episode;
  }
  return closest;
}

/// What came nearest to what, there.
Json nearest_json(const EpisodeRow* closest) {
  if (closest == nullptr || closest->nearest_link.empty()) return nullptr;
  return {{"episode", closest->episode},
          {"link", closest->nearest_link},
          {"object", closest->nearest_object}};
}

Json ghost_vox(const std::vector<EpisodeRow>& episodes) {
  std::optional<std::int64_t> sum;
  for (const EpisodeRow& episode : episodes) {
    if (episode.ghost_vox) sum = sum.value_or(0) + *episode.ghost_vox;
  }
  return sum ? Json(*sum) : Json(nullptr);
}

Json times_to_goal(const std::vector<EpisodeRow>& episodes) {
  std::vector<double> times_s;
  for (const EpisodeRow& episode : episodes) {
    if (episode.reached) times_s.push_back(episode.duration_s);
  }
  return spread(times_s);
}

Json path_lengths(const std::vector<EpisodeRow>& episodes) {
  std::vector<double> lengths;
  for (const EpisodeRow& episode : episodes) {
    if (episode.reached && episode.path_length) lengths.push_back(*episode.path_length);
  }
  return spread(lengths);
}

Json guesses_of(const ReplanRows& rows) {
  Json list = Json::array();
  for (const Replanner::GuessCount& guess : rows.guesses) {
    list.push_back({{"name", guess.guess}, {"tried", guess.tried}, {"led", guess.led}});
  }
  return list;
}

Json metrics_of(const ReplanRows& rows) {
  const auto& episodes = rows.episodes;
  const auto count = static_cast<double>(episodes.size());
  const auto successes = std::ranges::count(episodes, true, &EpisodeRow::success);
  const double time_s = sum_of(episodes, &EpisodeRow::duration_s);
  const auto solve_ms = joined(episodes, &EpisodeRow::solve_ms);
  const auto to_trajectory_ms = joined(episodes, &EpisodeRow::stamp_to_trajectory_ms);
  const auto map_age_ms = joined(episodes, &EpisodeRow::map_age_ms);
  const EpisodeRow* closest = closest_of(episodes);
  double jump = 0.0;
  for (const EpisodeRow& episode : episodes) {
    jump = std::max(jump, episode.splice_velocity_jump_max);
  }
  const auto steps = static_cast<double>(sum_of(episodes, &EpisodeRow::steps));
  const auto checks = static_cast<double>(sum_of(episodes, &EpisodeRow::checks));
  return {{"episodes", episodes.size()},
          {"success_share",
           episodes.empty() ? Json(nullptr) : Json(static_cast<double>(successes) / count)},
          {"collisions_true", sum_of(episodes, &EpisodeRow::collisions)},
          {"min_true_clearance_m",
           closest != nullptr ? Json(*closest->min_true_clearance_m) : Json(nullptr)},
          {"nearest", nearest_json(closest)},
          {"time_to_goal_s", times_to_goal(episodes)},
          {"path_length", path_lengths(episodes)},
          {"replans", sum_of(episodes, &EpisodeRow::replans)},
          {"guesses", guesses_of(rows)},
          {"solve_ms", spread_of(episodes, &EpisodeRow::solve_ms)},
          {"search_ms", spread_of(episodes, &EpisodeRow::search_ms)},
          {"stamp_to_trajectory_ms", spread_of(episodes, &EpisodeRow::stamp_to_trajectory_ms)},
          {"frame_to_trajectory_ms", spread_of(episodes, &EpisodeRow::frame_to_trajectory_ms)},
          {"check_hz", time_s > 0.0 ? Json(steps / time_s) : Json(nullptr)},
          {"new_check_hz", time_s > 0.0 ? Json(checks / time_s) : Json(nullptr)},
          {"map_age_ms", spread_of(episodes, &EpisodeRow::map_age_ms)},
          {"unknown_share", spread_of(episodes, &EpisodeRow::unknown_share)},
          {"splice_velocity_jump_max", jump},
          {"stops", sum_of(episodes, &EpisodeRow::stops)},
          {"slowdowns", sum_of(episodes, &EpisodeRow::slowdowns)},
          {"frames", sum_of(episodes, &EpisodeRow::frames)},
          {"frames_dropped", sum_of(episodes, &EpisodeRow::frames_dropped)},
          {"appear_frames", spread_of(episodes, &EpisodeRow::appear_frames)},
          {"clear_frames", spread_of(episodes, &EpisodeRow::clear_frames)},
          {"ghost_vox", ghost_vox(episodes)}};
}

Json collisions_of(const ReplanRows& rows) {
  Json list = Json::array();
  for (const ContactRow& contact : rows.contacts) {
    list.push_back({{"episode", contact.episode},
                    {"time_s", contact.time_s},
                    {"link", contact.link},
                    {"object", contact.object},
                    {"depth_m", contact.depth_m},
                    {"cause", contact.cause}});
  }
  return list;
}

Json failures_of(const ReplanFacts& facts, const ReplanRows& rows) {
  Json list = Json::array();
  for (const EpisodeRow& episode : rows.episodes) {
    if (episode.success) continue;
    Json failure = {{"episode", episode.episode}, {"reason", episode.reason}};
    if (!facts.again.empty()) {
      failure["again"] = facts.again +
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
               cell(quantile(r.solve_ms, 0.5), "%.2f ms"),
               cell(quantile(r.stamp_to_trajectory_ms, 0.95), "%.1f ms"), std::to_string(r.frames),
               std::to_string(r.frames_dropped)});
  }
  std::string text = table.text();
  if (shown < rows.episodes.size()) {
    text += "and " + std::to_string(rows.episodes.size() - shown) + " more in results.sqlite\n";
  }
  return text;
}

std::string verdict_text(const ReplanFacts& facts, const ReplanRows& rows, const Json& metrics) {
  const auto done = rows.episodes.size();
  const auto successes = std::ranges::count(rows.episodes, true, &EpisodeRow::success);
  const std::string count = std::to_string(successes) + " of " + std::to_string(done) +
                            (done == 1 ? " episode" : " episodes") +
                            " reached the goal without touching anything";
  if (facts.fault) return "Ended early: " + facts.fault->describe();
  if (facts.interrupted) {
    const std::string planned =
        facts.planned_episodes > 0 ? " of " + std::to_string(facts.planned_episodes) : "";
    return "Interrupted after " + std::to_string(done) + planned + " episodes: " + count +
           "; they are saved.";
  }
  std::string text = (static_cast<std::size_t>(successes) == done ? "Success: " : "Failed: ") +
                     count + "; " + cell(at(metrics, "/replans")) + " replans, " +
                     cell(at(metrics, "/stops")) + " stops, least true clearance " +
                     cell(at(metrics, "/min_true_clearance_m"), "%.3f m");
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

ReplanFacts facts_of(const ExperimentContext& context, const ReplanSettings& settings,
                     const RobotDescription& robot) {
  ReplanFacts facts;
  facts.provenance = provenance_of(context);
  facts.experiment = settings.type;
  facts.clock = settings.clock;
  facts.robot = robot.name;
  if (const Node* name = block_of(context.configuration, "optimiser").find("plugin")) {
    facts.optimiser = name->text();
  }
  return facts;
}

std::string command_again(const Configuration& configuration) {
  std::vector<std::string> overrides;
  find_overrides(configuration.root, overrides);
  std::string command = "sidestep run " + configuration.file.string();
  for (const std::string& override : overrides) {
    command += " --set '" + override.substr(std::string("--set ").size()) + "'";
  }
  return command;
}

ExperimentOutcome summarise_replan(const ReplanFacts& facts, const ReplanRows& rows) {
  const Json metrics = metrics_of(rows);
  const bool all_done = facts.planned_episodes == 0 ||
                        rows.episodes.size() == static_cast<std::size_t>(facts.planned_episodes);
  ExperimentOutcome outcome;
  outcome.interrupted = facts.interrupted;
  outcome.fault = facts.fault;
  outcome.success = all_done && !facts.fault && !facts.interrupted &&
                    std::ranges::all_of(rows.episodes, &EpisodeRow::success);
  outcome.verdict = verdict_text(facts, rows, metrics);
  outcome.table = table_text(rows);
  Json particulars = {
      {"clock", facts.clock}, {"robot", facts.robot}, {"optimiser", facts.optimiser}};
  particulars.update(metrics);
  particulars["collisions"] = collisions_of(rows);
  particulars["failures"] = failures_of(facts, rows);
  outcome.summary_json = summary_text(facts.provenance, facts.experiment, outcome, particulars);
  return outcome;
}

Result<ExperimentOutcome> conclude_replan(ReplanFacts facts, Result<void> done,
                                          const std::filesystem::path& results) {
  auto rows = read_replan_rows(results);
  if (!rows) return error_of(rows);
  if (!done && rows->episodes.empty()) return error_of(done);
  if (!done) facts.fault = std::move(done.error());
  return summarise_replan(facts, *rows);
}

}  // namespace sidestep
