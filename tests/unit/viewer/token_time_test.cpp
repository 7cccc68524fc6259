#include <algorithm>
#include <chrono>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "view_access.hpp"

namespace sidestep {
namespace {

using Compare = bool (*)(std::string_view, std::string_view) noexcept;

bool equal_until_they_differ(std::string_view a, std::string_view b) noexcept {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i] != b[i]) return false;
  }
  return true;
}

/// How much longer a guess takes to be refused whose first character is wrong than one whose last
/// is: the ratio of the lower quartiles of batches in turns, which leave out what else the machine
/// was at.
double first_to_last(Compare compare, std::size_t length) {
  constexpr int kBatches = 600;
  const int calls = length > 1000 ? 4 : 500;
  const std::string token(length, 'a');
  std::string guess = token;
  std::vector<double> times_ns[2];
  // Through memory, so that no call is taken out of its loop.
  const volatile Compare called = compare;
  volatile bool is_equal = false;
  for (int batch = 0; batch < 2 * kBatches; ++batch) {
    const auto is_last = static_cast<std::size_t>(batch % 2);
    const std::size_t wrong = is_last * (length - 1);
    guess[wrong] = 'b';
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < calls; ++i) is_equal = called(guess, token);
    const std::chrono::duration<double, std::nano> took = std::chrono::steady_clock::now() - begin;
    EXPECT_FALSE(is_equal);
    times_ns[is_last].push_back(took.count());
    guess[wrong] = 'a';
  }
  const auto quartile = [](std::vector<double>& values) {
    const auto at = values.begin() + kBatches / 4;
    std::nth_element(values.begin(), at, values.end());
    return *at;
  };
  return quartile(times_ns[0]) / quartile(times_ns[1]);
}

TEST(TokenTime, DoesNotTellWhereAGuessIsWrong) {
  for (const std::size_t length : {32, 100'000}) {
    EXPECT_NEAR(first_to_last(&equal_in_constant_time, length), 1.0, 0.15) << length;
  }
}

TEST(TokenTime, WouldTellWereTheComparisonToEndEarly) {
  EXPECT_LT(first_to_last(&equal_until_they_differ, 32), 0.7);
  EXPECT_LT(first_to_last(&equal_until_they_differ, 100'000), 0.1);
}

}  // namespace
}  // namespace sidestep
