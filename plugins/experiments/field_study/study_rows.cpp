#include "study_rows.hpp"

#include <sidestep/results/stored_values.hpp>

namespace sidestep {
namespace {

constexpr double kSkipped = -1.0;

std::string of_robot(const char* series, std::size_t robot) {
  return std::string(series) + "/" + std::to_string(robot);
}

void record_published(const PublishedOutcome& published, const std::string& kind, std::int64_t item,
                      Recorder& recorder) {
  const std::string prefix = "published." + kind + ".";
  recorder.add("robot", item, prefix + "failure_percent", published.failure_percent);
  recorder.add("robot", item, prefix + "iterations_mean", published.iterations_mean);
  recorder.add("robot", item, prefix + "iterations_sd", published.iterations_sd);
  recorder.add("robot", item, prefix + "cost_mean", published.cost_mean);
  recorder.add("robot", item, prefix + "cost_sd", published.cost_sd);
}

PublishedOutcome read_published(ItemReader& item, const std::string& kind) {
  const std::string prefix = "published." + kind + ".";
  return {item.number(prefix + "failure_percent"), item.number(prefix + "iterations_mean"),
          item.number(prefix + "iterations_sd"), item.number(prefix + "cost_mean"),
          item.number(prefix + "cost_sd")};
}

std::vector<Eigen::VectorXd> read_states(ColumnReader reader, int dof,
                                         std::optional<Error>& error) {
  std::vector<Eigen::VectorXd> states;
  for (int j = 0; j < dof; ++j) {
    const auto column = reader.column("q." + std::to_string(j));
    states.resize(column.size(), Eigen::VectorXd::Zero(dof));
    for (std::size_t i = 0; i < column.size(); ++i) states[i][j] = column[i];
  }
  if (!error) error = reader.error();
  return states;
}

std::vector<SceneRow> read_scenes(ColumnReader reader, std::optional<Error>& error) {
  const auto scene = reader.column("scene"), side = reader.column("mean_side_m");
  const auto plain = reader.column("unsigned.field_ms"), sign = reader.column("signed.field_ms");
  std::vector<SceneRow> rows;
  for (std::size_t i = 0; i < scene.size(); ++i) {
    rows.push_back({static_cast<std::int64_t>(scene[i]), side[i], {plain[i], sign[i]}});
  }
  if (!error) error = reader.error();
  return rows;
}

void read_fields(ColumnReader& reader, std::size_t kind, std::vector<ProblemOutcome>& rows) {
  const std::string prefix = std::string(kFieldNames[kind]) + ".";
  const auto status = reader.column(prefix + "status");
  const auto free = reader.column(prefix + "collision_free");
  const auto iterations = reader.column(prefix + "iterations");
  const auto steps = reader.column(prefix + "steps");
  const auto cost = reader.column(prefix + "cost");
  const auto clearance = reader.column(prefix + "clearance_m");
  const auto solve = reader.column(prefix + "solve_ms");
  const auto check = reader.column(prefix + "check_ms");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    FieldOutcome& field = rows[i].fields[kind];
    field.attempted = status[i] != kSkipped;
    if (!field.attempted) continue;
    field.status = static_cast<SolveStatus>(static_cast<int>(status[i]));
    field.collision_free = free[i] != 0.0;
    field.iterations = static_cast<int>(iterations[i]);
    field.steps = static_cast<int>(steps[i]);
    field.cost = cost[i];
    field.clearance_m = clearance[i];
    field.solve_ms = solve[i];
    field.check_ms = check[i];
  }
}

std::vector<ProblemOutcome> read_problems(ColumnReader reader, std::optional<Error>& error) {
  const auto problem = reader.column("problem");
  const auto start = reader.column("start_free"), goal = reader.column("goal_free");
  std::vector<ProblemOutcome> rows(problem.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i].problem = static_cast<std::int64_t>(problem[i]);
    rows[i].start_free = start[i] != 0.0;
    rows[i].goal_free = goal[i] != 0.0;
  }
  for (const std::size_t kind : {kUnsigned, kSigned}) read_fields(reader, kind, rows);
  if (!error) error = reader.error();
  return rows;
}

StudyRobotRows read_robot(ResultsReader& reader, std::size_t robot, const std::string& file,
                          std::optional<Error>& error) {
  ItemReader item(reader, "robot", static_cast<std::int64_t>(robot), file);
  StudyRobotRows rows;
  rows.name = item.text("name");
  rows.dof = item.integer("dof");
  rows.spheres = item.integer("spheres");
  rows.states = item.integer("states");
  rows.scenes = item.integer("scenes");
  rows.boxes_per_scene = item.integer("boxes_per_scene");
  rows.resolution_m = item.number("resolution_m");
  rows.planned = static_cast<std::int64_t>(item.number("planned"));
  if (item.number("has_published") != 0.0) {
    rows.published =
        PublishedComparison{read_published(item, "unsigned"), read_published(item, "signed")};
  }
  if (!error) error = item.error();
  rows.drawn_states = read_states({reader, of_robot("state", robot), file}, rows.dof, error);
  rows.drawn = read_scenes({reader, of_robot("scene", robot), file}, error);
  rows.problems = read_problems({reader, of_robot("problem", robot), file}, error);
  return rows;
}

}  // namespace

std::int64_t StudyRecord::planned() const {
  std::int64_t sum = 0;
  for (const StudyRobotRows& robot : robots) sum += robot.planned;
  return sum;
}

std::int64_t StudyRecord::solved() const {
  std::int64_t sum = 0;
  for (const StudyRobotRows& robot : robots) {
    sum += static_cast<std::int64_t>(robot.problems.size());
  }
  return sum;
}

void record_study(const StudyRecord& study, Recorder& recorder) {
  record_run_head(study, "study", recorder);
  recorder.add("study", 0, "confidence", study.confidence);
  recorder.add("study", 0, "bootstrap_samples", study.bootstrap_samples);
  recorder.add("study", 0, "published_as", study.published_as);
  recorder.add("study", 0, "robots", study.robots.size());
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    const StudyRobotRows& robot = study.robots[r];
    const auto item = static_cast<std::int64_t>(r);
    recorder.add("robot", item, "name", robot.name);
    recorder.add("robot", item, "dof", robot.dof);
    recorder.add("robot", item, "spheres", robot.spheres);
    recorder.add("robot", item, "states", robot.states);
    recorder.add("robot", item, "scenes", robot.scenes);
    recorder.add("robot", item, "boxes_per_scene", robot.boxes_per_scene);
    recorder.add("robot", item, "resolution_m", robot.resolution_m);
    recorder.add("robot", item, "planned", robot.planned);
    for (std::size_t i = 0; i < robot.drawn_states.size(); ++i) {
      const Eigen::VectorXd& q = robot.drawn_states[i];
      for (Eigen::Index j = 0; j < q.size(); ++j) {
        recorder.add(of_robot("state", r), static_cast<std::int64_t>(i), "q." + std::to_string(j),
                     q[j]);
      }
    }
    recorder.add("robot", item, "has_published", robot.published.has_value());
    if (!robot.published) continue;
    record_published(robot.published->unsigned_field, "unsigned", item, recorder);
    record_published(robot.published->signed_field, "signed", item, recorder);
  }
}

void record_scene(const SceneRow& scene, std::size_t robot, Recorder& recorder) {
  const std::string series = of_robot("scene", robot);
  recorder.add(series, scene.scene, "scene", scene.scene);
  recorder.add(series, scene.scene, "mean_side_m", scene.mean_side_m);
  recorder.add(series, scene.scene, "unsigned.field_ms", scene.field_ms[kUnsigned]);
  recorder.add(series, scene.scene, "signed.field_ms", scene.field_ms[kSigned]);
}

void record_problem(const ProblemOutcome& problem, std::size_t robot, Recorder& recorder) {
  const std::string series = of_robot("problem", robot);
  const std::int64_t item = problem.problem;
  recorder.add(series, item, "problem", item);
  recorder.add(series, item, "start_free", problem.start_free);
  recorder.add(series, item, "goal_free", problem.goal_free);
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    const FieldOutcome& field = problem.fields[kind];
    const std::string prefix = std::string(kFieldNames[kind]) + ".";
    recorder.add(series, item, prefix + "status",
                 field.attempted ? static_cast<double>(field.status) : kSkipped);
    recorder.add(series, item, prefix + "collision_free", field.collision_free);
    recorder.add(series, item, prefix + "iterations", field.iterations);
    recorder.add(series, item, prefix + "steps", field.steps);
    recorder.add(series, item, prefix + "cost", field.cost);
    recorder.add(series, item, prefix + "clearance_m", field.clearance_m);
    recorder.add(series, item, prefix + "solve_ms", field.solve_ms);
    recorder.add(series, item, prefix + "check_ms", field.check_ms);
  }
}

Result<StudyRecord> read_study(const std::filesystem::path& file) {
  auto reader = ResultsReader::open(file);
  if (!reader) return error_of(reader);
  StudyRecord study;
  if (auto read = read_run_head(**reader, "study", file.string(), study); !read) {
    return error_of(read);
  }
  ItemReader item(**reader, "study", 0, file.string());
  study.confidence = item.number("confidence");
  study.bootstrap_samples = item.integer("bootstrap_samples");
  study.published_as = item.text("published_as");
  const int robots = item.integer("robots");
  std::optional<Error> error = item.error();
  for (int r = 0; !error && r < robots; ++r) {
    study.robots.push_back(read_robot(**reader, static_cast<std::size_t>(r), file.string(), error));
  }
  if (error) return tl::make_unexpected(std::move(*error));
  return study;
}

}  // namespace sidestep
