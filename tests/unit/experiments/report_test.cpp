#include <sidestep/experiments/experiments.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/core/file.hpp>
#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "plan_parts.hpp"
#include "support/host_fixture.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

constexpr const char* kSummary = R"({
  "configuration": "synthetic", "experiment": "plan", "success": false, "interrupted": false,
  "verdict": "Failed: <one> of 2 plans & more.", "frames": 40, "bad_frames": 1,
  "bad_frame_errors": ["frame-7.depth.png: truncated"],
  "map": {"frame_ms": {"p50": 31.5, "p95": 40.25, "max": 52.0}, "occupied_vox": 12345,
          "resolution_m": 0.05},
  "plans": [
    {"name": "reach/table", "success": true, "valid_snapshot": true, "valid_independent": true,
     "min_clearance_m": 0.042, "duration_s": 6.0, "solve_ms": 123.4, "iterations": 17,
     "cost": 3.5, "reason": "", "attempts": 1,
     "checks": {"snapshot": {"outcome": "valid", "min_clearance_m": 0.042,
       "min_clearance_link": "arm", "min_clearance_time_s": 3.0, "min_self_clearance_m": null},
       "voxels": null, "scene": null}},
    {"name": "blocked", "success": false, "valid_snapshot": false, "valid_independent": false,
     "min_clearance_m": null, "duration_s": 0.0, "solve_ms": 0.0, "iterations": 0,
     "cost": 0.0, "reason": "the start is not valid: base is 0.1 m inside", "attempts": 0,
     "explanation": {"cost": 200.0, "hindrances": [
       {"term": "obstacle", "what": "base is 0.1 m inside <it>", "broken": true, "cost": 150.0,
        "share": 0.754, "states": [3, 5], "from_s": 1.8, "to_s": 2.25, "worst_s": 2.0}]},
     "checks": {"snapshot": null, "voxels": null, "scene": null}}],
  "provenance": {"version": "0.1.0", "git_hash": "abc123+", "cpu": "a CPU", "seed": 7}
})";

/// A room of 4 m x 3 m with a table, cut at one height, and a robot that drives past it.
void add_slice(ResultsStore& store, const std::string& series, std::int64_t item) {
  const int columns = 80, rows = 60;
  StoredArray distance_m{rows, columns, {}}, state{rows, columns, {}};
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double x = 0.05 * column, y = 0.05 * row;
      const double dx = std::max({1.8 - x, x - 2.6, 0.0}), dy = std::max({1.2 - y, y - 2.0, 0.0});
      const double table = std::hypot(dx, dy);
      const double wall = std::min({x, y, 4.0 - x, 3.0 - y});
      const double nearest = std::min(table, wall);
      distance_m.values.push_back(static_cast<float>(nearest));
      const bool shadow = x > 2.8 && y > 2.1;
      state.values.push_back(nearest < 0.05 ? 2.0F : shadow ? 1.0F : 0.0F);
    }
  }
  StoredArray circles{0, 4, {}}, base{0, 2, {}}, tip{0, 2, {}};
  for (int i = 0; i <= 24; ++i) {
    const double t = i / 24.0;
    const double x = 0.5 + 2.8 * t, y = 0.6 + 0.15 * std::sin(6.0 * t);
    const std::vector<double> values = {x, y, 0.25, t, x + 0.3, y + 0.4 * t, 0.1, t};
    circles.values.insert(circles.values.end(), values.begin(), values.end());
    circles.rows += 2;
    for (const auto& [path, u, v] : {std::tuple(&base, x, y), {&tip, x + 0.3, y + 0.4 * t}}) {
      path->values.push_back(static_cast<float>(u));
      path->values.push_back(static_cast<float>(v));
      ++path->rows;
    }
  }
  ASSERT_TRUE(store.add(series, item, "title", "Horizontal, 0.40 m above the ground"));
  ASSERT_TRUE(store.add(series, item, "u_label", "x [m]"));
  ASSERT_TRUE(store.add(series, item, "v_label", "y [m]"));
  ASSERT_TRUE(store.add(series, item, "u0_m", 0.0));
  ASSERT_TRUE(store.add(series, item, "v0_m", 0.0));
  ASSERT_TRUE(store.add(series, item, "step_m", 0.05));
  ASSERT_TRUE(store.add(series, item, "distance_m", distance_m));
  ASSERT_TRUE(store.add(series, item, "state", state));
  ASSERT_TRUE(store.add(series, item, "circles", circles));
  ASSERT_TRUE(store.add(series, item, "base_path", base));
  ASSERT_TRUE(store.add(series, item, "tip_path", tip));
}

void add_motion(ResultsStore& store, const std::string& series) {
  const double infinity = std::numeric_limits<double>::infinity();
  const std::tuple<const char*, const char*, double, double> joints[] = {
      {"odom_x", "m", -10.0, 10.0},
      {"odom_t", "rad", -infinity, infinity},
      {"arm_lift", "m", 0.0, 0.69}};
  std::int64_t item = 0;
  for (const auto& [name, unit, lower, upper] : joints) {
    ASSERT_TRUE(store.add("joint", item, "name", std::string_view(name)));
    ASSERT_TRUE(store.add("joint", item, "unit", std::string_view(unit)));
    ASSERT_TRUE(store.add("joint", item, "lower", lower));
    ASSERT_TRUE(store.add("joint", item, "upper", upper));
    ASSERT_TRUE(store.add("joint", item++, "max_velocity", 0.5));
  }
  StoredArray motion{101, 8, {}};
  for (int i = 0; i <= 100; ++i) {
    const double t = 0.06 * i, s = t / 6.0;
    for (const double value :
         {t, 0.05 + 0.3 * std::abs(s - 0.5), 3.0 * s * s * (3.0 - 2.0 * s), std::sin(t),
          0.35 - 0.34 * std::cos(t), 3.0 * s * (1.0 - s), std::cos(t), 0.34 * std::sin(t)}) {
      motion.values.push_back(static_cast<float>(value));
    }
  }
  ASSERT_TRUE(store.add(series, 0, "motion", motion));
  ASSERT_TRUE(store.add(series, 0, "speed_fraction", 0.8));
  ASSERT_TRUE(store.add(series, 0, "margin_m", 0.02));
}

void add_map(ResultsStore& store) {
  for (std::int64_t i = 0; i < 40; ++i) {
    ASSERT_TRUE(store.add("frame", i, "integrate_ms", 12.0 + static_cast<double>(i * 7 % 5)));
    ASSERT_TRUE(store.add("frame", i, "field_ms", 20.0 + static_cast<double>(i * 3 % 11)));
  }
  for (std::int64_t i = 0; i < 4; ++i) {
    StoredArray depth_m{60, 80, {}};
    for (int v = 0; v < 60; ++v) {
      for (int u = 0; u < 80; ++u) {
        const bool hole = (u - 40) * (u - 40) + (v - 20) * (v - 20) < 60;
        depth_m.values.push_back(hole ? std::nanf("") : 0.5F + 0.05F * static_cast<float>(60 - v));
      }
    }
    ASSERT_TRUE(store.add("depth", i, "sequence", 10.0 * static_cast<double>(i)));
    ASSERT_TRUE(store.add("depth", i, "depth_m", depth_m));
  }
}

class ReportTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    run_ = fs::path(testing::TempDir()) / (std::string("report_") + test->name());
    fs::remove_all(run_);
    fs::create_directories(run_);
    std::ofstream(run_ / "summary.json") << kSummary;
    std::ofstream(run_ / "effective_config.yaml") << "mapper: {plugin: voxel_grid}  # a <b>\n";
    auto store = ResultsStore::open(run_ / "results.sqlite", RunProvenance{});
    ASSERT_TRUE(store) << store.error().describe();
    add_map(**store);
    add_slice(**store, "slice/0", 0);
    add_motion(**store, "motion/0");
  }
  void TearDown() override {
    if (std::getenv("SIDESTEP_KEEP_TEST_FILES") == nullptr) fs::remove_all(run_);
  }
  [[nodiscard]] std::string file(const std::string& name) const {
    std::ifstream in(run_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  fs::path run_;
  testing_support::HostFixture host_{{PLUGIN_FOLDER}};
};

TEST_F(ReportTest, HoldsEverythingInOneFile) {
  const auto written = write_report(run_, host_.host);
  ASSERT_TRUE(written) << written.error().describe();
  const std::string html = file("report.html");
  EXPECT_THAT(html, HasSubstr("Failed: &lt;one&gt; of 2 plans &amp; more."));
  EXPECT_THAT(html, HasSubstr("0.042 m"));
  EXPECT_THAT(html, HasSubstr("the start is not valid: base is 0.1 m inside"));
  EXPECT_THAT(html, HasSubstr("base is 0.1 m inside &lt;it&gt;"));
  EXPECT_THAT(html, HasSubstr("75.4 %"));
  EXPECT_THAT(html, HasSubstr("1.80 s to 2.25 s"));
  EXPECT_THAT(html, HasSubstr("3 to 5"));
  EXPECT_THAT(html, HasSubstr("frame-7.depth.png: truncated"));
  EXPECT_THAT(html, HasSubstr("abc123+"));
  EXPECT_THAT(html, HasSubstr("# a &lt;b&gt;"));
  // The verdict comes before any picture, and nothing is fetched from anywhere.
  EXPECT_LT(html.find("class=\"verdict"), html.find("<img"));
  EXPECT_THAT(html, Not(HasSubstr("http")));
  for (std::size_t at = html.find(" src=\""); at != std::string::npos;
       at = html.find(" src=\"", at + 1)) {
    EXPECT_EQ(html.compare(at, 28, " src=\"data:image/png;base64,"), 0);
  }
}

TEST_F(ReportTest, WritesEveryPictureAsPng) {
  ASSERT_TRUE(write_report(run_, host_.host));
  for (const char* name :
       {"depth", "frame_times", "plan-1-reach_table-slice-1", "plan-1-reach_table-clearance",
        "plan-1-reach_table-joints", "plan-1-reach_table-velocities"}) {
    const std::string png = file(std::string(name) + ".png");
    ASSERT_GT(png.size(), 1000u) << name;
    EXPECT_EQ(png.substr(1, 3), "PNG") << name;
    EXPECT_THAT(file(std::string(name) + ".svg"), HasSubstr("<svg")) << name;
  }
  for (const auto& entry : fs::directory_iterator(run_)) {
    const std::string name = entry.path().filename().string();
    const bool picture = entry.path().extension() == ".png" || entry.path().extension() == ".svg";
    EXPECT_EQ(plan_report().writes(name), picture) << name;
  }
}

TEST_F(ReportTest, DrawsWhatThereIs) {
  { ASSERT_TRUE(ResultsStore::open(run_ / "results.sqlite", RunProvenance{})); }
  const auto written = write_report(run_, host_.host);
  ASSERT_TRUE(written) << written.error().describe();
  EXPECT_THAT(file("report.html"), Not(HasSubstr("<img")));
}

TEST_F(ReportTest, NamesWhatIsMissingOrDamaged) {
  std::ofstream(run_ / "summary.json") << "{ not json";
  auto written = write_report(run_, host_.host);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kIo);
  EXPECT_EQ(written.error().where, (run_ / "summary.json").string());

  fs::remove(run_ / "summary.json");
  written = write_report(run_, host_.host);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kNotFound);
}

TEST_F(ReportTest, SummariesOfOtherTypesAreDamaged) {
  const nlohmann::json summary = nlohmann::json::parse(kSummary);
  int refused = 0;
  for (const nlohmann::json& other :
       {nlohmann::json("text"), nlohmann::json::object({{"a", nlohmann::json::array()}})}) {
    for (const auto& [key, value] : summary.items()) {
      nlohmann::json damaged = summary;
      damaged[key] = other;
      ASSERT_TRUE(write_file(run_ / "summary.json", damaged.dump()));
      const auto written = write_report(run_, host_.host);
      const auto compared = compare_runs({run_, run_}, {}, host_.host);
      const bool is_shard = are_shards({run_});
      EXPECT_EQ(is_shard, key == "shard" && other.is_object());
      for (const Error* error :
           {written ? nullptr : &written.error(), compared ? nullptr : &compared.error()}) {
        if (error == nullptr) continue;
        ++refused;
        EXPECT_NE(error->describe().find("summary.json"), std::string::npos) << error->describe();
      }
    }
  }
  EXPECT_GT(refused, 0);
}

TEST_F(ReportTest, ComparesRunsPlanByPlan) {
  const fs::path html = run_ / "comparison.html";
  const auto table = compare_runs({run_, run_}, html, host_.host);
  ASSERT_TRUE(table) << table.error().describe();
  std::size_t rows = 0;
  for (std::size_t at = table->find("reach/table"); at != std::string::npos;
       at = table->find("reach/table", at + 1)) {
    ++rows;
  }
  EXPECT_EQ(rows, 2u);
  EXPECT_THAT(*table, HasSubstr("123.4 ms"));
  EXPECT_THAT(file("comparison.html"), HasSubstr("<td>blocked</td>"));
}

}  // namespace
}  // namespace sidestep
