#pragma once

#include <string>

#include <CLI/CLI.hpp>

namespace sidestep {

/// As CLI::Range, which lets nan pass: that is neither below nor above anything.
inline CLI::Validator number_range(double least, double most) {
  const CLI::Range range(least, most);
  const auto check = [=](std::string& text) {
    using CLI::detail::lexical_cast;
    double value = 0.0;
    const bool is_in = lexical_cast(text, value) && value >= least && value <= most;
    return is_in ? std::string() : "Value " + text + " is not a " + range.get_description();
  };
  return CLI::Validator(check, range.get_description());
}

}  // namespace sidestep
