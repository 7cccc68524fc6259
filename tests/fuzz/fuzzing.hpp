#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/log.hpp>

/// What the targets of tests/fuzz have in common. Each defines the function that libFuzzer calls
/// with every input.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace sidestep::fuzzing {

/// Ends the process, which is a finding, where something does not hold.
inline void require(bool holds, const std::string& what) {
  if (holds) return;
  std::fprintf(stderr, "not so: %s\n", what.c_str());
  std::abort();
}

/// An error says what is wrong, and names the input; several mistakes do each on its line.
inline void require_told(const Error& error, const std::string& input) {
  require(!error.message.empty(), "a failure says what is wrong");
  require(error.describe().find(input) != std::string::npos,
          "a failure names '" + input + "', not: " + error.describe());
}
inline void require_told(const std::vector<Error>& errors, const std::string& input) {
  for (const Error& error : errors) require_told(error, input);
}
/// Whether there is a value; if not, the error is as it should be.
template <class T>
[[nodiscard]] bool is_read(const Result<T>& result, const std::string& input) {
  if (!result) require_told(result.error(), input);
  return result.has_value();
}

[[nodiscard]] inline std::string text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// An input that stands for `count` files, with a line "%%" between each two; the last ones may be
/// missing.
[[nodiscard]] inline std::vector<std::string> parts_of(std::string_view text, std::size_t count) {
  constexpr std::string_view kBetween = "\n%%\n";
  std::vector<std::string> parts;
  while (parts.size() + 1 < count) {
    const std::size_t end = text.find(kBetween);
    parts.emplace_back(text.substr(0, end));
    text = end == std::string_view::npos ? "" : text.substr(end + kBetween.size());
  }
  parts.emplace_back(text);
  return parts;
}

class NoLog final : public Log {
 public:
  void write(LogLevel, std::string_view) override {}
};

}  // namespace sidestep::fuzzing
