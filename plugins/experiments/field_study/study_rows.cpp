#include "study_parts.hpp"

namespace sidestep {
namespace {

constexpr double kSkipped = -1.0;

std::string of_robot(const char* series, std::size_t robot) {
  return std::string(series) + "/" + std::to_string(robot);
}

StoredRow<StudyRecord> stored_study() {
  return StoredRow<StudyRecord>()
      .add("confidence", &StudyRecord::confidence)
      .add("bootstrap_samples", &StudyRecord::bootstrap_samples)
      .add("published_as", &StudyRecord::published_as)
      .add(
          "robots", [](const StudyRecord& study) { return study.robots.size(); },
          [](StudyRecord& study, std::size_t count) { study.robots.resize(count); });
}

StoredRow<PublishedOutcome> stored_published(const std::string& kind) {
  const std::string prefix = "published." + kind + ".";
  return StoredRow<PublishedOutcome>()
      .add(prefix + "failure_percent", &PublishedOutcome::failure_percent)
      .add(prefix + "iterations_mean", &PublishedOutcome::iterations_mean)
      .add(prefix + "iterations_sd", &PublishedOutcome::iterations_sd)
      .add(prefix + "cost_mean", &PublishedOutcome::cost_mean)
      .add(prefix + "cost_sd", &PublishedOutcome::cost_sd);
}

StoredRow<StudyRobotRows> stored_robot() {
  using Rows = StudyRobotRows;
  return StoredRow<Rows>()
      .add("name", &Rows::name)
      .add("dof", &Rows::dof)
      .add("spheres", &Rows::spheres)
      .add("states", &Rows::states)
      .add("scenes", &Rows::scenes)
      .add("boxes_per_scene", &Rows::boxes_per_scene)
      .add("resolution_m", &Rows::resolution_m)
      .add("planned", &Rows::planned)
      .add(
          "has_published", [](const Rows& rows) { return rows.published.has_value(); },
          [](Rows& rows, bool has) {
            if (has) rows.published.emplace();
          });
}

StoredRow<Eigen::VectorXd> stored_state(int dof) {
  StoredRow<Eigen::VectorXd> state;
  for (int j = 0; j < dof; ++j) {
    state.add(
        "q." + std::to_string(j), [j](const Eigen::VectorXd& q) { return q[j]; },
        [j, dof](Eigen::VectorXd& q, double value) {
          q.conservativeResize(dof);
          q[j] = value;
        });
  }
  return state;
}

const StoredRow<SceneRow>& stored_scene() {
  static const auto kScene =
      StoredRow<SceneRow>()
          .add("scene", &SceneRow::scene)
          .add("mean_side_m", &SceneRow::mean_side_m)
          .add(
              "unsigned.field_ms", [](auto& row) -> auto& { return row.field_ms[kUnsigned]; })
          .add(
              "signed.field_ms", [](auto& row) -> auto& { return row.field_ms[kSigned]; });
  return kScene;
}

const StoredRow<ProblemOutcome>& stored_problem() {
  static const auto kProblem = [] {
    using Field = FieldOutcome;
    StoredRow<ProblemOutcome> stored;
    stored.add("problem", &ProblemOutcome::problem)
        .add("start_free", &ProblemOutcome::start_free)
        .add("goal_free", &ProblemOutcome::goal_free);
    for (const std::size_t kind : {kUnsigned, kSigned}) {
      const auto add = [&](const char* key, auto member) {
        stored.add(
            std::string(kFieldNames[kind]) + "." + key,
            [ kind, member ](auto& row) -> auto& { return row.fields[kind].*member; });
      };
      stored.add(
          std::string(kFieldNames[kind]) + ".status",
          [kind](const ProblemOutcome& row) {
            const Field& field = row.fields[kind];
            return field.attempted ? static_cast<double>(field.status) : kSkipped;
          },
          [kind](ProblemOutcome& row, double status) {
            row.fields[kind].attempted = status != kSkipped;
            if (status != kSkipped) {
              row.fields[kind].status = static_cast<SolveStatus>(static_cast<int>(status));
            }
          });
      add("collision_free", &Field::collision_free);
      add("iterations", &Field::iterations);
      add("steps", &Field::steps);
      add("cost", &Field::cost);
      add("clearance_m", &Field::clearance_m);
      add("solve_ms", &Field::solve_ms);
      add("check_ms", &Field::check_ms);
    }
    return stored;
  }();
  return kProblem;
}

Result<StudyRobotRows> read_robot(ResultsReader& reader, std::size_t robot,
                                  const std::string& file) {
  const auto item = static_cast<std::int64_t>(robot);
  auto rows = SIDESTEP_TRY(stored_robot().read(reader, "robot", item, file));
  if (rows.published) {
    auto plain = SIDESTEP_TRY(stored_published("unsigned").read(reader, "robot", item, file));
    auto with_sign = SIDESTEP_TRY(stored_published("signed").read(reader, "robot", item, file));
    rows.published = PublishedComparison{plain, with_sign};
  }
  const auto read_series = [&](auto& into, const auto& stored, const char* series) -> Result<void> {
    auto read = SIDESTEP_TRY(stored.read_all(reader, of_robot(series, robot), file));
    for (auto& numbered : read) into.push_back(std::move(numbered.second));
    return {};
  };
  SIDESTEP_TRY(read_series(rows.drawn_states, stored_state(rows.dof), "state"));
  SIDESTEP_TRY(read_series(rows.drawn, stored_scene(), "scene"));
  SIDESTEP_TRY(read_series(rows.problems, stored_problem(), "problem"));
  return rows;
}

}  // namespace

void record_study(const StudyRecord& study, Recorder& recorder) {
  record_run_head(study, "study", recorder);
  stored_study().record(study, "study", 0, recorder);
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    const StudyRobotRows& robot = study.robots[r];
    const auto item = static_cast<std::int64_t>(r);
    stored_robot().record(robot, "robot", item, recorder);
    stored_state(robot.dof).record_all(robot.drawn_states, of_robot("state", r), recorder);
    if (!robot.published) continue;
    stored_published("unsigned").record(robot.published->unsigned_field, "robot", item, recorder);
    stored_published("signed").record(robot.published->signed_field, "robot", item, recorder);
  }
}

void record_scene(const SceneRow& scene, std::size_t robot, Recorder& recorder) {
  stored_scene().record(scene, of_robot("scene", robot), scene.scene, recorder);
}

void record_problem(const ProblemOutcome& problem, std::size_t robot, Recorder& recorder) {
  stored_problem().record(problem, of_robot("problem", robot), problem.problem, recorder);
}

Result<StudyRecord> read_study(const std::filesystem::path& path) {
  auto reader = SIDESTEP_TRY(ResultsReader::open(path));
  const std::string file = path.string();
  auto head = SIDESTEP_TRY(read_run_head(*reader, "study", file));
  auto study = SIDESTEP_TRY(stored_study().read(*reader, "study", 0, file));
  static_cast<DividedRun&>(study) = std::move(head);
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    study.robots[r] = SIDESTEP_TRY(read_robot(*reader, r, file));
  }
  return study;
}

}  // namespace sidestep
