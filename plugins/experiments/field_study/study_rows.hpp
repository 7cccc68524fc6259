#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/results/divided_run.hpp>
#include <sidestep/results/recorder.hpp>
#include <sidestep/runtime/results_store.hpp>
#include "study_problems.hpp"
#include "study_settings.hpp"

namespace sidestep {

struct SceneRow {
  std::int64_t scene = 0;
  double mean_side_m = 0.0;
  std::array<double, 2> field_ms{};  ///< Time to make each kind of field.
};

/// What a results store holds of one robot.
struct StudyRobotRows {
  std::string name;
  int dof = 0;
  int spheres = 0;
  int states = 0;
  int scenes = 0;
  int boxes_per_scene = 0;
  double resolution_m = 0.0;
  std::int64_t planned = 0;  ///< Problems that this store should come to hold.
  std::optional<PublishedComparison> published;
  std::vector<Eigen::VectorXd> drawn_states;
  std::vector<SceneRow> drawn;           ///< By scene.
  std::vector<ProblemOutcome> problems;  ///< By problem.

  [[nodiscard]] std::int64_t pairs() const { return std::int64_t{states} * (states - 1) / 2; }
  [[nodiscard]] std::int64_t scene_of(const ProblemOutcome& problem) const {
    return problem.problem / pairs();
  }
};

/// What a results store holds of a study: everything that its summary is made from.
struct StudyRecord : DividedRun {
  double confidence = 0.95;
  int bootstrap_samples = 0;
  std::string published_as;
  std::vector<StudyRobotRows> robots;

  [[nodiscard]] std::int64_t planned() const {
    return std::accumulate(robots.begin(), robots.end(), std::int64_t{0},
                           [](std::int64_t sum, const auto& r) { return sum + r.planned; });
  }
  [[nodiscard]] std::int64_t solved() const {
    return std::accumulate(robots.begin(), robots.end(), std::int64_t{0},
                           [](auto sum, const auto& r) { return sum + std::ssize(r.problems); });
  }
};

/// Everything but what is solved: series "study", "robot" and "state/ROBOT".
void record_study(const StudyRecord& study, Recorder& recorder);
/// Series "scene/ROBOT".
void record_scene(const SceneRow& scene, std::size_t robot, Recorder& recorder);
/// Series "problem/ROBOT".
void record_problem(const ProblemOutcome& problem, std::size_t robot, Recorder& recorder);

/// Reads back what was recorded. Fails with kIo where the store is that of no study.
[[nodiscard]] Result<StudyRecord> read_study(const std::filesystem::path& file);

}  // namespace sidestep
