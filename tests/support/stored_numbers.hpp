#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/runtime/results_store.hpp>

namespace sidestep::testing_support {

/// By series, item and key.
using StoredNumbers = std::map<std::tuple<std::string, std::int64_t, std::string>, double>;

/// Every number of these series in the results of a run, but for keys that end in one of `but`.
[[nodiscard]] inline StoredNumbers stored_numbers(const std::filesystem::path& run,
                                                  const std::vector<std::string>& all_series,
                                                  const std::vector<std::string>& but) {
  StoredNumbers numbers;
  const auto reader = ResultsReader::open(run / "results.sqlite");
  EXPECT_TRUE(reader);
  if (!reader) return numbers;
  for (const std::string& series : all_series) {
    EXPECT_TRUE(
        (*reader)->visit(series, [&](std::int64_t item, std::string_view key, double value) {
          if (std::ranges::any_of(but, [&](const auto& end) { return key.ends_with(end); })) return;
          numbers[{series, item, std::string(key)}] = value;
        }));
  }
  return numbers;
}

}  // namespace sidestep::testing_support
