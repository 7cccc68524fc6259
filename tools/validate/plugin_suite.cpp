#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>
#include <stop_token>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <sidestep/experiments/experiments.hpp>
#include "conformance/test_host.hpp"

#include "subject.hpp"

namespace sidestep::conformance {
namespace {

namespace fs = std::filesystem;
using validate::cases_of;
using validate::subject;

/// What holds of every plugin, by its declaration.
TEST(Plugin, SaysWhatItIsInOneLine) {
  const PluginInfo& info = subject()->info();
  for (const std::string& text : {info.name, info.version, info.doc}) {
    EXPECT_FALSE(text.empty());
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
  }
  EXPECT_EQ(info.name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_"), std::string::npos)
      << info.name;
}

void expect_documented(const Schema& schema) {
  std::set<std::string> names;
  for (const Parameter& parameter : schema) {
    EXPECT_TRUE(names.insert(parameter.name).second) << parameter.name << " is declared twice";
    EXPECT_FALSE(parameter.doc.empty()) << parameter.name << " has no doc";
    EXPECT_LE(parameter.min, parameter.max) << parameter.name;
    expect_documented(parameter.parameters);
  }
}
TEST(Plugin, DocumentsItsParameters) { expect_documented(subject()->info().schema); }

TEST(Plugin, AcceptsItsOwnDefaults) {
  if (subject()->info().kind == PluginKind::kExperiment) GTEST_SKIP() << "checked with its file";
  std::vector<Error> errors;
  const Node filled = subject()->host().with_defaults(subject()->info().kind, subject()->block());
  subject()->host().check(subject()->info().kind, filled, errors);
  for (const Error& error : errors) ADD_FAILURE() << error.describe();
}

TEST(Plugin, RefusesParametersThatItDoesNotHave) {
  Node block = subject()->block();
  block.entries().push_back({"no_such_parameter", {}, Node(Node::Scalar{"1", false}, {})});
  std::vector<Error> errors;
  subject()->host().check(subject()->info().kind, block, errors);
  EXPECT_FALSE(errors.empty());
}

/// A run of the case's configuration into a new folder, by each test of its own.
class ExperimentConformance : public testing::TestWithParam<int> {
 protected:
  ExperimentConformance() { fs::create_directories(folder_); }

  Result<ExperimentOutcome> run(std::stop_token stop = {}) {
    ExperimentContext context{subject()->configuration(),
                              subject()->host(),
                              log_,
                              subject()->documents(),
                              folder_,
                              0,
                              2,
                              std::move(stop)};
    return run_experiment(context);
  }
  [[nodiscard]] const fs::path& folder() const { return folder_; }

 private:
  RecordingLog log_;
  fs::path folder_ = fs::temp_directory_path() / "run";  // which the test's process has of its own
};

std::string text_of(const fs::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST_P(ExperimentConformance, NeedsTheBlocksThatItNamesAndRefusesOthers) {
  const ExperimentFacts facts = subject()->make<Experiment>()->facts();
  for (const std::string& name : facts.blocks) {
    Configuration without = subject()->configuration();
    std::erase_if(without.root.entries(), [&](const Node::Entry& e) { return e.key == name; });
    EXPECT_FALSE(check_configuration(without, subject()->host()).empty())
        << "goes without '" << name << "'";
  }
  for (const std::string name : {"source", "robot", "mapper", "field", "optimiser", "executor"}) {
    const auto has = [&](const std::vector<std::string>& blocks) {
      return std::ranges::find(blocks, name) != blocks.end();
    };
    if (has(facts.blocks) || has(facts.optional_blocks)) continue;
    Configuration more = subject()->configuration();
    Node block(Node::Map{{"plugin", {}, Node(Node::Scalar{"none", false}, {})}}, {});
    more.root.entries().push_back({name, {}, std::move(block)});
    EXPECT_FALSE(check_configuration(more, subject()->host()).empty()) << "takes '" << name << "'";
  }
}

TEST_P(ExperimentConformance, LeavesVerdictSummaryTableAndPage) {
  const auto outcome = run();
  ASSERT_TRUE(outcome) << outcome.error().describe();
  EXPECT_FALSE(outcome->interrupted);
  EXPECT_FALSE(outcome->verdict.empty());
  const auto summary = nlohmann::json::parse(text_of(folder() / "summary.json"), nullptr, false);
  ASSERT_TRUE(summary.is_object());
  EXPECT_EQ(summary.value("verdict", ""), outcome->verdict);
  EXPECT_TRUE(fs::is_regular_file(folder() / "results.sqlite"));
  const std::string page = text_of(folder() / "report.html");
  EXPECT_NE(page.find("</html>"), std::string::npos);

  std::istringstream table(text_of(folder() / "table.csv"));
  std::string header, line;
  std::getline(table, header);
  int rows = 0;
  for (; std::getline(table, line); ++rows) {
    if (line.find('"') != std::string::npos) continue;  // A cell may hold a comma.
    EXPECT_EQ(std::ranges::count(line, ','), std::ranges::count(header, ',')) << line;
  }
  EXPECT_TRUE(header.empty() || rows > 0) << "a table without rows";
}

TEST_P(ExperimentConformance, IsShownAgainAndCompared) {
  ASSERT_TRUE(run());
  const std::string page = text_of(folder() / "report.html");
  fs::remove(folder() / "report.html");
  const auto written = write_report(folder(), subject()->host());
  ASSERT_TRUE(written) << written.error().describe();
  EXPECT_EQ(text_of(folder() / "report.html"), page);
  const auto compared = compare_runs({folder(), folder()}, {}, subject()->host());
  EXPECT_TRUE(compared) << compared.error().describe();
}

TEST_P(ExperimentConformance, EndsSoonAndSaysSoWhenToldToStop) {
  std::stop_source stop;
  stop.request_stop();
  const auto began = std::chrono::steady_clock::now();
  const auto outcome = run(stop.get_token());
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(20));
  if (!outcome) return;
  EXPECT_TRUE(outcome->interrupted);
  EXPECT_FALSE(outcome->success);
}

INSTANTIATE_TEST_SUITE_P(plugin, ExperimentConformance,
                         testing::ValuesIn(cases_of(PluginKind::kExperiment, [] { return 0; })));

}  // namespace
}  // namespace sidestep::conformance
