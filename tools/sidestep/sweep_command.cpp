#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

#include <sidestep/core/file.hpp>
#include <sidestep/experiments/experiments.hpp>
#include <sidestep/report/chart.hpp>
#include <sidestep/report/report_parts.hpp>

#include "commands.hpp"
#include "jobs.hpp"
#include "sweep.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using report::Row;

/// Of one sweep: what it is, where its runs are, and how those that are not done ended.
struct Work {
  std::string name;
  Sweep sweep;
  fs::path out;
  std::vector<std::string> faults;  ///< One a run; empty where nothing is known.

  [[nodiscard]] fs::path folder(std::size_t run) const { return out / sweep.runs[run].folder; }
};

Json summary_in(const fs::path& folder) {
  return Json::parse(read_file(folder / "summary.json").value_or(""), nullptr, false);
}

/// Whether a run has come to its end: neither interrupted nor cut short by a fault, and all of its
/// report, which is written last, is there.
bool is_done(const fs::path& folder) {
  const std::string page = read_file(folder / "report.html").value_or("");
  if (page.find("</html>", page.size() - std::min<std::size_t>(page.size(), 20)) ==
      std::string::npos) {
    return false;
  }
  const Json summary = summary_in(folder);
  return summary.is_object() && summary.value("interrupted", true) == false &&
         summary.value("fault", Json()).is_null();
}

std::vector<std::size_t> open_runs(const Work& work) {
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < work.sweep.runs.size(); ++i) {
    if (!is_done(work.folder(i))) open.push_back(i);
  }
  return open;
}

/// The mistakes that any of the runs would begin with.
std::vector<Error> check_runs(const Sweep& sweep, const std::optional<int>& task,
                              Configuration& configuration, Log& log) {
  CheckedConfiguration loaded = load_configuration(sweep.configuration, {}, log);
  if (!loaded.session) return std::move(loaded.errors);
  configuration = loaded.configuration;
  std::vector<Error> errors;
  if (task) return errors;  // its run looks for itself
  for (const SweepRun& run : sweep.runs) {
    auto reading = read_configuration(configuration.file, run.overrides(), YamlDocumentReader());
    auto found = check_configuration(reading.configuration, loaded.session->host());
    found.insert(found.begin(), reading.errors.begin(), reading.errors.end());
    for (Error& error : found) {
      error.message = "run " + run.folder + ": " + error.message;
      errors.push_back(std::move(error));
    }
    constexpr std::size_t kEnough = 20;
    if (errors.size() >= kEnough) break;
  }
  return errors;
}

/// Makes the folder, or takes up one that holds the same sweep of the same configuration.
Result<void> open_folder(const Work& work, const Configuration& configuration) {
  Json runs = Json::array();
  for (const SweepRun& run : work.sweep.runs) runs.push_back({{run.folder, run.overrides()}});
  const std::string text =
      Json({{"runs", runs}, {"configuration", to_yaml(configuration.root, false)}}).dump(1);
  std::error_code error;
  fs::create_directories(work.out, error);
  if (error) return fail(ErrorCode::kIo, "cannot be made: " + error.message(), work.out.string());
  const fs::path file = work.out / "sweep.json";
  if (!fs::exists(file, error)) return write_file(file, text);
  const auto before = SIDESTEP_TRY(read_file(file));
  if (before == text) return {};
  return fail(ErrorCode::kConfig, "the folder holds another sweep, or one of another configuration",
              work.out.string(), "give another with --out");
}

/// That nobody else does this sweep on this machine, for as long as the file is open.
Result<int> lock_folder(const fs::path& folder) {
  const int file = open((folder / "sweep.lock").c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
  if (file >= 0 && flock(file, LOCK_EX | LOCK_NB) == 0) return file;
  const bool is_taken = file >= 0 && errno == EWOULDBLOCK;
  if (file >= 0) close(file);
  if (is_taken) return fail(ErrorCode::kConfig, "another sweep is at work in it", folder.string());
  return fail(ErrorCode::kIo, "cannot be locked", (folder / "sweep.lock").string());
}

Job job_of(const Work& work, std::size_t run) {
  const SweepRun& its = work.sweep.runs[run];
  Job job{its.folder.substr(0, its.folder.find('-')),
          {"run", work.sweep.configuration, "--out", work.folder(run).string()}};
  for (const std::string& value : its.overrides()) {
    job.arguments.insert(job.arguments.end(), {"--set", value});
  }
  return job;
}

void run_here(Work& work, int at_once, const std::stop_token& stop, Console& console) {
  const auto open = open_runs(work);
  std::vector<Job> jobs;
  jobs.reserve(open.size());
  for (const std::size_t run : open) jobs.push_back(job_of(work, run));
  std::int64_t done = 0;
  const auto ends = run_jobs(
      jobs, at_once, stop, [&](const std::string& line) { console.info(line); },
      [&](std::size_t, const JobEnd&) {
        console.progress(++done, static_cast<std::int64_t>(jobs.size()), "runs");
      });
  console.end_progress();
  for (std::size_t i = 0; i < open.size(); ++i) {
    work.faults[open[i]] =
        ends[i].code ? "exit code " + std::to_string(*ends[i].code) : ends[i].fault;
  }
}

/// One run, for a scheduler.
ExitCode run_task(const Work& work, std::size_t run, const std::stop_token& stop,
                  Console& console) {
  if (is_done(work.folder(run))) {
    console.info(work.sweep.runs[run].folder + " is done");
    return ExitCode::kSuccess;
  }
  const auto ends =
      run_jobs({job_of(work, run)}, 1, stop, [&](const std::string& line) { console.info(line); });
  if (ends[0].code) return static_cast<ExitCode>(*ends[0].code);
  console.error(work.sweep.runs[run].folder + ": " + ends[0].fault);
  return ExitCode::kFault;
}

std::string task_log(std::size_t run) { return "task-" + std::to_string(run + 1) + ".log"; }

/// Numbers from 1 as Slurm writes them, e.g. "1-4,7".
std::string array_of(const std::vector<std::size_t>& runs) {
  std::string text;
  for (std::size_t i = 0; i < runs.size();) {
    std::size_t last = i;
    while (last + 1 < runs.size() && runs[last + 1] == runs[last] + 1) ++last;
    text += (text.empty() ? "" : ",") + std::to_string(runs[i] + 1);
    if (last > i) text += "-" + std::to_string(runs[last] + 1);
    i = last + 1;
  }
  return text;
}

/// What a command of Slurm prints; nothing where it fails.
std::optional<std::string> printed_by(const std::string& command) {
  std::FILE* const pipe = popen(command.c_str(), "re");
  if (pipe == nullptr) return {};
  std::string text;
  std::array<char, 4096> part{};
  while (std::fgets(part.data(), static_cast<int>(part.size()), pipe) != nullptr) {
    text += part.data();
  }
  if (pclose(pipe) != 0) return {};
  return text;
}

/// Whether a job is waiting or running; where Slurm does not answer, it may be.
bool is_queued(const std::string& job) {
  const auto jobs = printed_by("squeue -h -o %F 2>/dev/null");
  return !jobs || ("\n" + *jobs).find("\n" + job + "\n") != std::string::npos;
}

/// Submits what is open as a job array, and returns its number.
Result<std::string> submit(const Work& work, const SweepOptions& options) {
  const auto open = open_runs(work);
  std::error_code error;
  const std::string program = fs::read_symlink("/proc/self/exe", error).string();
  const std::string out = fs::absolute(work.out, error).string();
  const std::string script = "#!/bin/sh\nexec " + shell_word(program) + " sweep " +
                             shell_word(fs::absolute(options.file, error).string()) + " --out " +
                             shell_word(out) + " --task \"$SLURM_ARRAY_TASK_ID\"\n";
  SIDESTEP_TRY(write_file(work.out / "sweep.sbatch", script));
  for (const std::size_t run : open) fs::remove(work.out / task_log(run), error);
  std::string command = "sbatch --parsable --job-name=" + shell_word(options.file.stem().string()) +
                        " --array=" + array_of(open) +
                        " --output=" + shell_word(out + "/task-%a.log");
  for (const std::string& option : options.slurm_options) command += " " + shell_word(option);
  auto job = printed_by(command + " " + shell_word(out + "/sweep.sbatch"));
  if (!job) {
    return fail(ErrorCode::kNotFound, "does not take the job array", "sbatch",
                "is Slurm installed, and are there no more runs than its MaxArraySize?");
  }
  std::string number = job->substr(0, job->find_first_of(";\n"));  // and a cluster's name
  SIDESTEP_TRY(write_file(work.out / "sweep.job", number + "\n"));
  return number;
}

/// Has Slurm run what is open, a task a run, and waits for it. Goes on with an array that an
/// earlier command has left.
Result<void> run_by_slurm(Work& work, const SweepOptions& options, const std::stop_token& stop,
                          Console& console) {
  const auto open = open_runs(work);
  if (open.empty()) return {};
  std::string job = read_file(work.out / "sweep.job").value_or("\n");
  job.pop_back();
  if (job.empty() || !is_queued(job)) job = SIDESTEP_TRY(submit(work, options));
  console.info("waiting for job " + job + " of Slurm");
  while (!stop.stop_requested() && is_queued(job)) {
    std::this_thread::sleep_for(std::chrono::seconds(1));
    console.progress(static_cast<std::int64_t>(open.size() - open_runs(work).size()),
                     static_cast<std::int64_t>(open.size()), "runs");
  }
  console.end_progress();
  if (stop.stop_requested()) (void)printed_by("scancel " + shell_word(job));
  std::error_code ignored;
  for (const std::size_t run : open) {
    work.faults[run] = fs::exists(work.out / task_log(run), ignored)
                           ? "its task ended before it was done, see " + task_log(run)
                           : "no task has begun it";
  }
  return {};
}

/// The number that a cell begins with, as "5.7 ms" does.
std::optional<double> number_in(const std::string& cell) {
  char* end = nullptr;
  const double value = std::strtod(cell.c_str(), &end);
  if (end == cell.c_str() || !std::isfinite(value)) return {};
  return value;
}

/// A column of numbers over a swept one, a line of means for each combination of the others.
std::optional<Figure> chart_of(const ComparedRuns& table, const std::string& name_of_table,
                               std::size_t x_column, std::size_t y_column,
                               const std::vector<std::size_t>& others) {
  std::map<std::string, std::map<double, std::vector<double>>> lines;
  std::string unit;
  Range x_range{HUGE_VAL, -HUGE_VAL}, y_range{HUGE_VAL, -HUGE_VAL};
  for (const Row& row : table.rows) {
    const auto x = number_in(row[x_column]), y = number_in(row[y_column]);
    if (!x || !y) continue;
    std::string name;
    for (const std::size_t other : others) {
      if (row[other] != "-") name += (name.empty() ? "" : ", ") + row[other];
    }
    lines[name][*x].push_back(*y);
    if (unit.empty() && row[y_column].find(' ') != std::string::npos) {
      unit = " [" + row[y_column].substr(row[y_column].find(' ') + 1) + "]";
    }
    x_range.include(*x);
    y_range.include(*y);
  }
  if (lines.empty()) return {};
  constexpr double kWidth = 460.0, kHeight = 300.0, kLegendRow = 20.0;
  const double legend_height =
      lines.size() > 1 ? kLegendRow * (static_cast<double>(lines.size()) + 1.0) : 0.0;
  Figure figure{name_of_table + std::to_string(y_column), table.header[y_column],
                Canvas(kWidth, kHeight + legend_height)};
  constexpr Colour kColours[] = {palette::kBlue,   palette::kVermilion, palette::kGreen,
                                 palette::kOrange, palette::kPurple,    palette::kSky,
                                 palette::kBlack};
  Axes axes(figure.canvas, {0.0, 0.0, kWidth, kHeight}, x_range.padded(0.05), y_range.padded(0.08),
            {"", table.header[x_column], table.header[y_column] + unit});
  axes.grid();
  std::vector<LegendEntry> legend;
  for (const auto& [name, points] : lines) {
    Stroke stroke{kColours[legend.size() % std::size(kColours)], 1.8, {}};
    if (legend.size() >= std::size(kColours)) stroke.dashes = {5.0, 3.0};
    std::vector<double> xs, means;
    for (const auto& [x, values] : points) {
      double sum = 0.0;
      for (const double y : values) {
        figure.canvas.circle(axes.at(x, y), 2.5, stroke.colour.with_alpha(0.6));
        sum += y;
      }
      xs.push_back(x);
      means.push_back(sum / static_cast<double>(values.size()));
    }
    axes.line(xs, means, stroke);
    constexpr std::size_t kLongest = 60;
    legend.push_back({name.substr(0, kLongest), LegendEntry::Mark::kLine, stroke});
  }
  axes.finish();
  if (legend.size() > 1) draw_legend(figure.canvas, {10.0, kHeight + 14.0}, kWidth - 20.0, legend);
  return figure;
}

/// Of each column of numbers that differ, over the first swept one of numbers.
std::vector<Figure> charts_of(const ComparedRuns& table, const std::string& name,
                              std::size_t swept) {
  const auto differs = [&](std::size_t column) {
    return std::ranges::any_of(
        table.rows, [&](const Row& row) { return row[column] != table.rows.front()[column]; });
  };
  const auto is_numeric = [&](std::size_t column) {
    return differs(column) && std::ranges::any_of(table.rows, [&](const Row& row) {
             return number_in(row[column]).has_value();
           });
  };
  std::size_t x = 1;
  while (x <= swept && !is_numeric(x)) ++x;
  if (x > swept) return {};
  std::vector<std::size_t> others;
  for (std::size_t column = 1; column < table.header.size(); ++column) {
    if (table.header[column].ends_with("seed")) continue;  // a repetition
    // Of what is no number, what a row is of: a planner's name, a plan's.
    const bool names = column > swept && differs(column) && !is_numeric(column);
    if ((column <= swept && column != x && differs(column)) || names) others.push_back(column);
  }
  std::vector<Figure> figures;
  for (std::size_t column = swept + 1; column + 1 < table.header.size(); ++column) {
    if (!is_numeric(column)) continue;
    if (auto chart = chart_of(table, name, x, column, others)) figures.push_back(std::move(*chart));
  }
  return figures;
}

std::string csv_line(const Row& cells) {
  std::string line;
  for (const std::string& cell : cells) {
    const bool is_plain = cell.find_first_of(",\"\n") == std::string::npos;
    std::string text = is_plain ? cell : "\"";
    for (const char c : is_plain ? "" : cell)
      text += c == '"' ? std::string("\"\"") : std::string(1, c);
    line += (line.empty() ? "" : ",") + text + (is_plain ? "" : "\"");
  }
  return line + "\n";
}

/// What the runs that are done come to: a table for the terminal; sweep.csv, sweep.html and its
/// pictures in the folder.
Result<std::string> collect(const Work& work, Host& host) {
  std::vector<fs::path> folders;
  std::vector<std::size_t> runs;
  for (std::size_t i = 0; i < work.sweep.runs.size(); ++i) {
    if (!is_done(work.folder(i))) continue;
    folders.push_back(work.folder(i));
    runs.push_back(i);
  }
  int tables = 0;
  std::string text, html = "<h1>" + escape_html(work.name) + "</h1>\n", csv;
  for (ComparedRuns& table : SIDESTEP_TRY(compared_rows(folders, host))) {
    // The swept values in place of the names of run and configuration.
    const auto replace = [&](Row& row, const std::string& name, const auto& value_of) {
      row.erase(row.begin(), row.begin() + 2);
      Row first = {name};
      for (const std::string& key : work.sweep.keys) first.push_back(value_of(key));
      row.insert(row.begin(), first.begin(), first.end());
    };
    replace(table.header, "run", [](const std::string& key) { return key; });
    for (std::size_t r = 0; r < table.rows.size(); ++r) {
      const SweepRun& run = work.sweep.runs[runs[table.runs[r]]];
      replace(table.rows[r], run.folder.substr(0, run.folder.find('-')),
              [&](const std::string& key) {
                for (const auto& [its, value] : run.values) {
                  if (its == key) return value;
                }
                return std::string("-");
              });
    }
    TextTable shown(table.header);
    for (const Row& row : table.rows) shown.add(row);
    text += "\n" + shown.text();
    csv += csv_line(table.header);
    for (const Row& row : table.rows) csv += csv_line(row);
    html += report::html_table(table.header, table.rows);
    const auto figures =
        charts_of(table, "sweep-" + std::to_string(++tables) + "-", work.sweep.keys.size());
    html += SIDESTEP_TRY(report::figure_section(figures, work.out));
  }
  SIDESTEP_TRY(write_file(work.out / "sweep.csv", csv));
  SIDESTEP_TRY(write_file(work.out / "sweep.html", html_page("Sidestep: sweep", html)));
  return text;
}

/// What is said at the end, and the exit code.
std::pair<std::string, ExitCode> verdict_of(const Work& work, bool was_stopped) {
  std::size_t succeeded = 0, failed = 0;
  std::string open;
  for (std::size_t i = 0; i < work.sweep.runs.size(); ++i) {
    if (!is_done(work.folder(i))) {
      const std::string& fault = work.faults[i];
      open += "\n  " + work.sweep.runs[i].folder + (fault.empty() ? "" : ": " + fault);
      continue;
    }
    ++(summary_in(work.folder(i)).value("success", false) ? succeeded : failed);
  }
  const std::size_t all = work.sweep.runs.size(), left = all - succeeded - failed;
  std::string text = "Of " + std::to_string(all) + " runs " + std::to_string(succeeded) +
                     " succeeded and " + std::to_string(failed) + " failed.";
  if (left > 0) {
    text += " Not done: " + std::to_string(left) + "; the same command goes on with them:" + open;
  }
  const ExitCode code = left > 0 && !was_stopped ? ExitCode::kFault
                        : left + failed > 0      ? ExitCode::kTaskFailed
                                                 : ExitCode::kSuccess;
  return {text, code};
}

}  // namespace

ExitCode sweep_command(const SweepOptions& options) {
  Console console;
  Work work;
  work.name = options.file.stem().string();
  auto errors = read_sweep(options.file, YamlDocumentReader(), work.sweep);
  Configuration configuration;
  if (errors.empty()) {
    open_plugins();
    const std::size_t runs = work.sweep.runs.size();
    const auto task = static_cast<std::size_t>(options.task.value_or(1));
    if (task > runs) {
      errors.push_back({ErrorCode::kConfig, "there are " + std::to_string(runs) + " runs",
                        "--task " + std::to_string(task), "", nullptr});
    } else {
      errors = check_runs(work.sweep, options.task, configuration, console);
    }
  }
  if (!errors.empty()) {
    print_errors(errors);
    return exit_code(errors);
  }
  const auto refuse = [](const Error& error) {
    print_errors({error});
    return exit_code(error);
  };
  work.faults.resize(work.sweep.runs.size());
  work.out = options.out.value_or(fs::path("out") / options.file.stem());
  const StopOnSignal stop;
  if (const auto opened = open_folder(work, configuration); !opened) return refuse(opened.error());
  if (options.task)
    return run_task(work, static_cast<std::size_t>(*options.task) - 1, stop.token(), console);
  const auto lock = lock_folder(work.out);
  if (!lock) return refuse(lock.error());
  if (!options.slurm) {
    run_here(work, options.jobs, stop.token(), console);
  } else if (const auto ran = run_by_slurm(work, options, stop.token(), console); !ran) {
    return refuse(ran.error());
  }
  Session session(RunSettings{.threads = 1}, &console);
  const auto table = collect(work, session.host());
  auto [verdict, code] = verdict_of(work, stop.token().stop_requested());
  if (!table) code = worse(code, refuse(table.error()));
  if (table)
    verdict = *table + "\n" + verdict + "\n\nreport: " + (work.out / "sweep.html").string();
  std::printf("%s\n", verdict.c_str());
  return code;
}

}  // namespace sidestep
