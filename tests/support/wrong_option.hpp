#pragma once

#include <ostream>
#include <string>

#include <gtest/gtest.h>

namespace sidestep::testing_support {

/// A mistake in a plugin's options.
template <class Options>
struct WrongOption {
  std::string parameter;  ///< That the error is to name.
  void (*spoil)(Options&);

  friend void PrintTo(const WrongOption& wrong, std::ostream* out) { *out << wrong.parameter; }
};

/// Checks that the default options with this mistake tell it, and it alone.
template <class Options>
void expect_told(const WrongOption<Options>& wrong) {
  Options options;
  wrong.spoil(options);
  const auto mistakes = options.check();
  ASSERT_EQ(mistakes.size(), 1U) << wrong.parameter;
  EXPECT_EQ(mistakes[0].parameters.at(0), wrong.parameter) << mistakes[0].what;
}

}  // namespace sidestep::testing_support
