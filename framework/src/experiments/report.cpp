#include <algorithm>

#include <nlohmann/json.hpp>

#include <sidestep/core/file.hpp>
#include <sidestep/experiments/experiments.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "find_experiment.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;
using namespace report;

/// Deeper than any summary is nested. What copies one recurses.
constexpr int kDeepestValue = 100;

Result<Json> read_summary(const fs::path& run) {
  const fs::path file = run / "summary.json";
  auto text = read_file(file);
  if (!text) {
    return fail(ErrorCode::kNotFound, "the folder holds no finished run", file.string(),
                "give the folder that `sidestep run` wrote to");
  }
  bool is_too_deep = false;
  const auto is_wanted = [&](int depth, Json::parse_event_t, const Json&) {
    is_too_deep = is_too_deep || depth > kDeepestValue;
    return !is_too_deep;
  };
  Json summary = Json::parse(*text, is_wanted, false);
  if (is_too_deep || !summary.is_object())
    return fail(ErrorCode::kIo, "the summary is damaged", file.string());
  // What all experiments' have. Reports show other values as they are.
  for (const auto& [key, type] : {std::pair("configuration", Json::value_t::string),
                                  {"experiment", Json::value_t::string},
                                  {"success", Json::value_t::boolean},
                                  {"verdict", Json::value_t::string}}) {
    const auto found = summary.find(key);
    if (found != summary.end() && found->type() != type) {
      return fail(
          ErrorCode::kIo,
          "the summary is damaged: '" + std::string(key) + "' is no " + Json(type).type_name(),
          file.string());
    }
  }
  return summary;
}

/// What `work` makes of summaries: where a value is not of the type that it has in any run of ours,
/// they are damaged.
template <class Work>
auto of_summaries(const fs::path& run, Work work) -> decltype(work()) {
  try {
    return work();
  } catch (const Json::exception& exception) {
    return fail(ErrorCode::kIo, std::string("the summary is damaged: ") + exception.what(),
                (run / "summary.json").string());
  }
}

std::string origin_section(const Json& summary, const fs::path& run) {
  std::string html = "<h2>Made with</h2>\n<table>\n";
  const Json provenance = at(summary, "/provenance");
  if (provenance.is_object()) {
    for (const auto& [key, value] : provenance.items()) {
      html += "<tr><td>" + escape_html(key) + "</td><td class=\"text\">" +
              escape_html(cell(value, "%.0f")) + "</td></tr>\n";
    }
  }
  html += "</table>\n";
  if (const auto config = read_file(run / "effective_config.yaml")) {
    html += "<h2>Configuration, as it took effect</h2>\n<pre>" + escape_html(*config) + "</pre>\n";
  }
  return html;
}

/// Everything that summary and store tell of a run, verdict first.
Result<std::string> report_body(const Json& summary, ResultsReader& results, const fs::path& run,
                                Host& host) {
  const auto found = SIDESTEP_TRY(
      find_experiment(cell(at(summary, "/experiment")), (run / "summary.json").string(), host));
  const bool success = at(summary, "/success") == Json(true);
  std::string html = "<h1>" + escape_html(cell(at(summary, "/configuration"))) + "</h1>\n";
  html += std::string("<p class=\"verdict ") + (success ? "success" : "failure") + "\">" +
          escape_html(cell(at(summary, "/verdict"))) + "</p>\n";
  const auto body = SIDESTEP_TRY(found.experiment->report().body(summary, results, run));
  html += body;
  html += origin_section(summary, run);
  return html;
}

/// A run by the name of its folder: several may be of one configuration.
std::string run_name(const fs::path& run) {
  return (run.has_filename() ? run : run.parent_path()).filename().string();  // of "out/demo/", too
}

Columns compared_columns(const RunReport& report) {
  Columns columns = report.columns->compared();
  std::ranges::copy(report.compared_of_run, std::back_inserter(columns));
  return columns;
}

/// What a run adds to a comparison.
void add_rows(const RunReport& report, const std::string& name, std::size_t run,
              const Json& summary, ComparedRuns& compared) {
  const Json items = report.compared_rows != nullptr ? report.compared_rows(summary)
                                                     : report.columns->rows_of(summary);
  for (const Json& item : items) {
    Json shown = summary;
    shown.update(item);
    Row row = cells_of(shown, compared_columns(report));
    row.insert(row.begin(), {name, cell(at(summary, "/configuration"))});
    row.push_back(cell(at(summary, "/provenance/git_hash")));
    compared.rows.push_back(std::move(row));
    compared.runs.push_back(run);
  }
}

}  // namespace

Result<std::string> results_markdown(Host& host) {
  const auto experiments = SIDESTEP_TRY(find_experiments(host));
  std::string text =
      "# Results\n\nThe rows of `summary.json`, written by `sidestep plugins --results`. A key is "
      "the "
      "path of a value in a row;\n`table.csv` has a column of that name. Tables of terminal and "
      "report, and `sidestep report` on several runs, show them.\n";
  for (const FoundExperiment& found : experiments) {
    const RunReport& report = found.experiment->report();
    if (report.columns == nullptr) continue;
    text += "\n## " + found.name() + "\n\n" + report.columns->reference();
  }
  return text;
}

Result<void> write_report(const fs::path& run, Host& host) {
  const auto summary = SIDESTEP_TRY(read_summary(run));
  auto results = SIDESTEP_TRY(ResultsReader::open(run / "results.sqlite"));
  auto body =
      SIDESTEP_TRY(of_summaries(run, [&] { return report_body(summary, *results, run, host); }));
  const std::string title = "Sidestep: " + cell(at(summary, "/configuration"));
  return write_file(run / "report.html", html_page(title, body));
}

Result<void> save_outcome(const ExperimentOutcome& outcome, const fs::path& run, Host& host) {
  auto saved = write_file(run / "summary.json", outcome.summary_json);
  if (saved && !outcome.table_csv.empty()) {
    saved = write_file(run / "table.csv", outcome.table_csv);
  }
  return saved ? write_report(run, host) : saved;
}

Result<std::vector<ComparedRuns>> compared_rows(const std::vector<fs::path>& runs, Host& host) {
  const auto experiments = SIDESTEP_TRY(find_experiments(host));
  std::vector<Json> summaries;
  summaries.reserve(runs.size());
  for (const fs::path& run : runs) {
    summaries.push_back(SIDESTEP_TRY(read_summary(run)));
  }
  std::vector<ComparedRuns> all;
  for (const FoundExperiment& found : experiments) {
    const RunReport& report = found.experiment->report();
    if (report.columns == nullptr) continue;
    ComparedRuns compared;
    for (std::size_t r = 0; r < runs.size(); ++r) {
      if (at(summaries[r], "/experiment") != Json(found.name())) continue;
      SIDESTEP_TRY(of_summaries(runs[r], [&]() -> Result<void> {
        add_rows(report, run_name(runs[r]), r, summaries[r], compared);
        return {};
      }));
    }
    if (compared.rows.empty()) continue;
    compared.header = names_of(compared_columns(report));
    compared.header.insert(compared.header.begin(), {"run", "configuration"});
    compared.header.push_back("commit");
    all.push_back(std::move(compared));
  }
  return all;
}

Result<std::string> compare_runs(const std::vector<fs::path>& runs, const fs::path& html,
                                 Host& host) {
  std::string text, body;
  for (const ComparedRuns& compared : SIDESTEP_TRY(compared_rows(runs, host))) {
    TextTable table(compared.header);
    for (const Row& row : compared.rows) table.add(row);
    text += (text.empty() ? "" : "\n") + table.text();
    body += html_table(compared.header, compared.rows);
  }
  if (!html.empty()) {
    const std::string page = html_page("Sidestep: comparison", "<h1>Runs compared</h1>\n" + body);
    SIDESTEP_TRY(write_file(html, page));
  }
  return text;
}

bool are_shards(const std::vector<fs::path>& runs) {
  return !runs.empty() && std::ranges::all_of(runs, [](const fs::path& run) {
    const auto summary = read_summary(run);
    return summary && at(*summary, "/shard").is_object();
  });
}

Result<ExperimentOutcome> merge_shards(const std::vector<fs::path>& runs, const fs::path& out,
                                       Host& host) {
  std::error_code error;
  for (const fs::path& run : runs) {
    if (!fs::equivalent(run, out, error)) continue;
    return fail(ErrorCode::kConfig, "the folder holds one of the shards", out.string(),
                "give another one with --merged");
  }
  const Json summary = SIDESTEP_TRY(read_summary(runs.front()));
  const auto found =
      SIDESTEP_TRY(find_experiment(cell(at(summary, "/experiment")), runs.front().string(), host));
  auto outcome = SIDESTEP_TRY(found.experiment->merge(runs, out));
  Result<void> written;
  if (const auto configuration = read_file(runs.front() / "effective_config.yaml")) {
    written = write_file(out / "effective_config.yaml", *configuration);
  }
  if (written) written = save_outcome(outcome, out, host);
  if (!written) return error_of(written);
  return outcome;
}

}  // namespace sidestep
