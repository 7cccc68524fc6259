#include <sidestep/problems/recorded_problems.hpp>

#include <array>
#include <cmath>

#include "recorded_robot.hpp"

namespace sidestep {
namespace {

constexpr int kMostCounted = 1'000'000;
constexpr double kMostNodes = 1e8;

GridSpec read_grid(const JsonEntry& grid) {
  GridSpec read;
  read.resolution_m = grid["cell"].positive();
  read.origin_m = grid["origin"].vector3().array() - 0.5 * read.resolution_m;
  const JsonEntry counts = grid["n"];
  (void)counts.vector3();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    read.size_vox[static_cast<Eigen::Index>(axis)] = counts.at(axis).integer(1, kMostCounted);
  }
  if (read.size_vox.cast<double>().prod() > kMostNodes) {
    counts.complain("the grid has more than 1e8 nodes");
  }
  return read;
}

std::vector<RecordedBox> read_scene(const JsonEntry& scene) {
  std::vector<RecordedBox> boxes;
  for (const JsonEntry& box : scene.items()) {
    boxes.push_back({box["lo"].vector3(), box["hi"].vector3()});
    if (!(boxes.back().lower_m.array() <= boxes.back().upper_m.array()).all()) {
      box.complain("`lo` lies above `hi`");
    }
  }
  return boxes;
}

RecordedSettings read_settings(const JsonEntry& settings) {
  RecordedSettings read;
  read.support_states = settings["states"].integer(3, 10'000);
  const int intervals = settings["total_step"].integer(1, 10'000);
  if (intervals + 1 != read.support_states) {
    settings["states"].complain("there is one state more than `total_step`, " +
                                std::to_string(intervals) + ", and not " +
                                std::to_string(read.support_states));
  }
  read.dt_s = settings["total_time_s"].positive() / intervals;
  read.qc = settings["Qc_diag"].positive();
  read.interpolated_checks = settings["obs_check_inter"].integer(0, 1000);
  read.epsilon_m = settings["epsilon"].number();
  read.sigma_obstacle_m = settings["cost_sigma"].positive();
  read.sigma_endpoint = settings["conf_prior_sigma"].positive();
  if (settings["vel_prior_sigma"].positive() != read.sigma_endpoint) {
    settings["vel_prior_sigma"].complain("only as large as `conf_prior_sigma` is supported");
  }
  for (const char* velocity : {"start_vel", "goal_vel"}) {
    if (settings[velocity].number() != 0.0) {
      settings[velocity].complain("only motions from rest to rest are supported");
    }
  }
  return read;
}

/// Where in a row of results each number stands.
class Columns {
 public:
  explicit Columns(const JsonEntry& names) : count_(names.size()) {
    for (std::size_t k = 0; k < kNames.size(); ++k) {
      for (std::size_t column = 0; column < count_; ++column) {
        if (names.at(column).text() == kNames[k]) at_[k] = column;
      }
      if (at_[k] == kNone) names.complain(std::string("there is no column `") + kNames[k] + "`");
    }
  }

  [[nodiscard]] RecordedOutcome read(const JsonEntry& row, int scenes, int pairs) const {
    RecordedOutcome outcome;
    if (row.size() != count_) {
      row.complain("there are " + std::to_string(row.size()) +
                   " values, but `result_columns` has " + std::to_string(count_));
    }
    const auto value = [&](std::size_t k) { return row.at(at_[k]); };
    outcome.scene = value(0).integer(0, scenes - 1);
    outcome.pair = value(1).integer(0, pairs - 1);
    outcome.iterations = value(2).integer(-1, kMostCounted);
    outcome.initial_cost = value(3).number();
    outcome.final_cost = value(4).number();
    outcome.free_at_checks = value(5).flag();
    outcome.free_exactly = value(6).flag();
    outcome.total_ms = 1e-3 * value(7).number();
    outcome.optimise_ms = 1e-3 * value(8).number();
    return outcome;
  }

 private:
  static constexpr std::array kNames = {"scene",          "pair",         "iterations",
                                        "initial_cost",   "final_cost",   "cf_sdf_checked",
                                        "cf_exact_dense", "cpu_us_total", "cpu_us_optimise"};
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  static constexpr std::array<std::size_t, kNames.size()> nowhere() {
    std::array<std::size_t, kNames.size()> at{};
    at.fill(kNone);
    return at;
  }

  std::size_t count_ = 0;
  std::array<std::size_t, kNames.size()> at_ = nowhere();
};

RecordedRun read_run(const JsonEntry& run, const Columns& columns, int scenes, int pairs) {
  RecordedRun read;
  read.label = run["label"].text();
  const std::string field = run["field"].text();
  read.is_signed = field == "sdf";
  if (!read.is_signed && field != "usdf") {
    run["field"].complain("expected \"sdf\" or \"usdf\", found \"" + field + "\"");
  }
  read.relative_tolerance = run["rel_tol"].number();
  if (!(read.relative_tolerance >= 0.0 && read.relative_tolerance <= 1.0)) {
    run["rel_tol"].complain("expected a number from 0 to 1");
  }
  read.max_iterations = run["max_iter"].integer(1, kMostCounted);
  for (const JsonEntry& row : run["results"].items()) {
    read.outcomes.push_back(columns.read(row, scenes, pairs));
  }
  return read;
}

void read_configurations(const JsonEntry& root, RecordedProblems& problems) {
  const JsonEntry configurations = root["configurations"];
  const std::size_t dof = configurations.at(0).size();
  if (dof == 0) configurations.at(0).complain("a configuration needs at least one number");
  for (const JsonEntry& configuration : configurations.items()) {
    problems.configurations.push_back(configuration.numbers(dof));
  }
  const int last = static_cast<int>(problems.configurations.size()) - 1;
  for (const JsonEntry& pair : root["pairs"].items()) {
    (void)pair.numbers(2);
    problems.pairs.emplace_back(pair.at(0).integer(0, last), pair.at(1).integer(0, last));
  }
}

}  // namespace

Result<RecordedProblems> read_recorded_problems(const std::filesystem::path& file) {
  auto json = SIDESTEP_TRY(JsonEntry::read(file.string()));
  const JsonEntry root(json);
  RecordedProblems problems;
  problems.file = file;
  problems.grid = read_grid(root["grid"]);
  problems.first_node_m = root["grid"]["origin"].vector3();
  for (const JsonEntry& scene : root["scenes"].items()) {
    problems.scenes.push_back(read_scene(scene));
  }
  read_configurations(root, problems);
  problems.settings = read_settings(root["settings"]);
  if (json.error) return tl::make_unexpected(std::move(*json.error));

  const int dof = static_cast<int>(problems.configurations.front().size());
  auto robot = read_recorded_robot(root["robot"], dof);
  if (json.error) return tl::make_unexpected(std::move(*json.error));
  if (!robot) {
    return tl::make_unexpected(robot.error().wrapped(ErrorCode::kConfig, "there is no such robot",
                                                     file.string() + ": robot"));
  }
  problems.robot = std::move(robot->model);
  problems.has_base = robot->has_base;

  const Columns columns(root["result_columns"]);
  if (json.error) return tl::make_unexpected(std::move(*json.error));
  for (const JsonEntry& run : root["runs"].items()) {
    problems.runs.push_back(read_run(run, columns, static_cast<int>(problems.scenes.size()),
                                     static_cast<int>(problems.pairs.size())));
  }
  if (json.error) return tl::make_unexpected(std::move(*json.error));
  return problems;
}

}  // namespace sidestep
