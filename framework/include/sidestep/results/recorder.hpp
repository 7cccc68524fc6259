#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include <sidestep/runtime/results_store.hpp>

namespace sidestep {

/// Adds to a store and keeps the first failure, so that recording reads without a check a line.
class Recorder {
 public:
  explicit Recorder(ResultsStore& store) : store_(store) {}

  template <class Value>
  void add(std::string_view series, std::int64_t item, std::string_view key, const Value& value) {
    if constexpr (std::is_arithmetic_v<Value>) {
      note(store_.add(series, item, key, static_cast<double>(value)));
    } else {
      note(store_.add(series, item, key, value));
    }
  }
  /// The same, but for an array without values: nothing.
  void add_filled(std::string_view series, std::int64_t item, std::string_view key,
                  const StoredArray& array) {
    if (!array.values.empty()) add(series, item, key, array);
  }
  /// Commits; the first failure since the last call, if there was one.
  [[nodiscard]] Result<void> commit();

 private:
  void note(Result<void> result) {
    if (!result && !error_) error_ = std::move(result.error());
  }
  ResultsStore& store_;
  std::optional<Error> error_;
};

/// Series "bad_frame": what was wrong with each frame that could not be used.
void record_bad_frames(std::span<const Error> bad_frames, Recorder& recorder);

}  // namespace sidestep
