#include <algorithm>
#include <cstdio>
#include <numeric>
#include <sstream>

#include <sidestep/experiments/experiments.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "fuzzing.hpp"
#include "support/host_fixture.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

namespace {

/// A line is `SERIES ITEM KEY VALUE`; `[ROWS COLUMNS]` is an array of the numbers from 0 on.
void add_row(const std::string& line, ResultsStore& store) {
  std::istringstream words(line);
  std::string series, key, value;
  std::int64_t item = 0;
  words >> series >> item >> key;
  std::getline(words >> std::ws, value);
  StoredArray array;
  char* end = nullptr;
  const double number = std::strtod(value.c_str(), &end);
  Result<void> added;
  if (std::sscanf(value.c_str(), "[%d %d]", &array.rows, &array.columns) == 2) {
    if (std::min(array.rows, array.columns) < 0 || std::max(array.rows, array.columns) > 100)
      return;
    array.values.resize(static_cast<std::size_t>(array.rows * array.columns));
    std::iota(array.values.begin(), array.values.end(), 0.0F);
    added = store.add(series, item, key, array);
  } else if (!value.empty() && *end == '\0') {
    added = store.add(series, item, key, number);
  } else {
    added = store.add(series, item, key, value);
  }
  require(added.has_value(), "a row is added");
}

}  // namespace

// The summary of a run, and rows of its results.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static testing_support::HostFixture host{{PLUGIN_FOLDER}};
  const testing_support::TemporaryFolder folder;
  const auto parts = parts_of(text_of(data, size), 2);
  (void)folder.write("run/summary.json", parts[0]);
  const auto run = folder.path() / "run";
  {
    const auto store = ResultsStore::open(run / "results.sqlite", RunProvenance{});
    require(store.has_value(), "there is a store");
    std::istringstream lines(parts[1]);
    for (std::string line; std::getline(lines, line);) add_row(line, **store);
    require((*store)->commit().has_value(), "rows are kept");
  }
  const std::string here = folder.path().string();
  (void)is_read(write_report(run, host.host), here);
  (void)is_read(compare_runs({run, run}, {}, host.host), here);
  if (are_shards({run, run})) {
    (void)is_read(merge_shards({run, run}, folder.path() / "whole", host.host), here);
  }
  return 0;
}
