#include <sidestep/runtime/results_store.hpp>

#include <cmath>
#include <fstream>
#include <limits>

#include <gtest/gtest.h>

namespace sidestep {
namespace {

namespace fs = std::filesystem;

/// A folder of this test's own, removed at the end.
class ResultsStoreTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(testing::TempDir()) / (std::string("results_store_") + test->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] fs::path file() const { return folder_ / "results.sqlite"; }

  fs::path folder_;
};

TEST_F(ResultsStoreTest, ReadsBackWhatWasWritten) {
  const double infinity = std::numeric_limits<double>::infinity();
  {
    auto store = ResultsStore::open(file(), RunProvenance{});
    ASSERT_TRUE(store) << store.error().describe();
    ASSERT_TRUE((*store)->add("frame", 10, "integrate_ms", 4.25));
    ASSERT_TRUE((*store)->add("frame", 2, "integrate_ms", 1.0 / 3.0));
    ASSERT_TRUE((*store)->add("frame", 11, "integrate_ms", infinity));
    ASSERT_TRUE((*store)->add("frame", 12, "integrate_ms", std::nan("")));
    ASSERT_TRUE((*store)->add("frame", 2, "field_ms", 9.0));
    ASSERT_TRUE((*store)->add("plan", 0, "reason", "arm 'x' is 0.1 m inside; DROP TABLE"));
    ASSERT_TRUE((*store)->add("slice", 3, "distance", StoredArray{2, 3, {1, 2, 3, 4, 5, 6}}));
    ASSERT_TRUE((*store)->add("slice", 1, "distance", StoredArray{0, 0, {}}));
  }
  auto reader = ResultsReader::open(file());
  ASSERT_TRUE(reader) << reader.error().describe();
  const auto column = (*reader)->column("frame", "integrate_ms");
  ASSERT_TRUE(column);
  ASSERT_EQ(column->size(), 4u);
  EXPECT_EQ((*column)[0], 1.0 / 3.0);
  EXPECT_EQ((*column)[1], 4.25);
  EXPECT_EQ((*column)[2], infinity);
  EXPECT_TRUE(std::isnan((*column)[3]));
  EXPECT_TRUE((*reader)->column("frame", "nothing")->empty());
  EXPECT_EQ(**(*reader)->text("plan", 0, "reason"), "arm 'x' is 0.1 m inside; DROP TABLE");
  EXPECT_FALSE((*reader)->text("plan", 1, "reason")->has_value());
  EXPECT_EQ(**(*reader)->number("frame", 2, "field_ms"), 9.0);
  EXPECT_EQ(*(*reader)->array_items("slice", "distance"), (std::vector<std::int64_t>{1, 3}));
  const auto array = (*reader)->array("slice", 3, "distance");
  ASSERT_TRUE(array && *array);
  EXPECT_EQ((*array)->rows, 2);
  EXPECT_EQ((*array)->columns, 3);
  EXPECT_EQ((*array)->values, (std::vector<float>{1, 2, 3, 4, 5, 6}));
}

TEST_F(ResultsStoreTest, KeepsWhatWasCommittedWhenTheRunDies) {
  auto store = ResultsStore::open(file(), RunProvenance{});
  ASSERT_TRUE(store) << store.error().describe();
  ASSERT_TRUE((*store)->add("frame", 0, "ms", 1.0));
  ASSERT_TRUE((*store)->commit());
  ASSERT_TRUE((*store)->add("frame", 1, "ms", 2.0));
  // What lies on the disk at this moment is what a killed run would leave.
  const fs::path left = folder_ / "left";
  fs::create_directories(left);
  for (const char* suffix : {"", "-wal"}) {
    fs::copy_file(file().string() + suffix, (left / "results.sqlite").string() + suffix);
  }
  auto reader = ResultsReader::open(left / "results.sqlite");
  ASSERT_TRUE(reader) << reader.error().describe();
  EXPECT_EQ(*(*reader)->column("frame", "ms"), (std::vector<double>{1.0}));
}

TEST_F(ResultsStoreTest, ReplacesAnEarlierFile) {
  for (const double value : {1.0, 2.0}) {
    auto store = ResultsStore::open(file(), RunProvenance{});
    ASSERT_TRUE(store) << store.error().describe();
    ASSERT_TRUE((*store)->add("run", static_cast<std::int64_t>(value), "value", value));
  }
  auto reader = ResultsReader::open(file());
  ASSERT_TRUE(reader) << reader.error().describe();
  EXPECT_EQ(*(*reader)->column("run", "value"), (std::vector<double>{2.0}));
}

TEST_F(ResultsStoreTest, RefusesAnArrayOfTheWrongSize) {
  auto store = ResultsStore::open(file(), RunProvenance{});
  ASSERT_TRUE(store) << store.error().describe();
  const auto added = (*store)->add("slice", 0, "distance", StoredArray{2, 2, {1, 2, 3}});
  ASSERT_FALSE(added);
  EXPECT_EQ(added.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(added.error().where, "slice/distance");
}

TEST_F(ResultsStoreTest, NamesTheFileThatIsMissingOrForeign) {
  const auto missing = ResultsReader::open(file());
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(missing.error().where, file().string());

  std::ofstream(file()) << "this is no database, and longer than a page header needs to be: "
                        << std::string(200, 'x');
  const auto foreign = ResultsReader::open(file());
  ASSERT_FALSE(foreign);
  EXPECT_EQ(foreign.error().code, ErrorCode::kIo);
  EXPECT_EQ(foreign.error().where, file().string());
}

TEST_F(ResultsStoreTest, FailsWhereItCannotWrite) {
  const auto store = ResultsStore::open(folder_ / "no" / "such" / "results.sqlite", {});
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().code, ErrorCode::kIo);
}

TEST(Provenance, TellsBuildAndMachine) {
  const RunProvenance provenance = current_provenance();
  EXPECT_FALSE(provenance.version.empty());
  EXPECT_FALSE(provenance.git_hash.empty());
  EXPECT_NE(provenance.cpu.find("cores"), std::string::npos);
  EXPECT_GT(provenance.threads, 0);
}

}  // namespace
}  // namespace sidestep
