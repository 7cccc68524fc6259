#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

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
  [[nodiscard]] Result<void> commit() {
    note(store_.commit());
    if (auto error = std::exchange(error_, std::nullopt)) {
      return tl::make_unexpected(*std::move(error));
    }
    return {};
  }

 private:
  void note(Result<void> result) {
    if (!result && !error_) error_ = std::move(result.error());
  }
  ResultsStore& store_;
  std::optional<Error> error_;
};

/// Series "bad_frame": what was wrong with each frame that could not be used.
inline void record_bad_frames(std::span<const Error> bad_frames, Recorder& recorder) {
  std::int64_t item = 0;
  for (const Error& error : bad_frames)
    recorder.add("bad_frame", item++, "error", error.describe());
}

/// How rows of one type are stored: each value is declared once, recording and reading back follow.
/// Numbers, truth values and enumerations are stored as numbers, strings as text, lists of numbers
/// and a StoredArray as arrays of 32-bit floats, optionals as what they hold. Optionals and lists
/// that are empty and arrays without columns are not stored; any other value that is missing is an
/// error when a row is read.
template <class Row>
class StoredRow {
 public:
  using Rows = std::vector<std::pair<std::int64_t, Row>>;  ///< With their items, ascending.

  /// `access`: a member of the row, or a function from a row to a reference to the value.
  template <class Access>
  StoredRow& add(std::string key, Access access) {
    return add(
        std::move(key), [access](const Row& row) { return std::invoke(access, row); },
        [access](Row& row, auto value) {
          using Value = std::remove_reference_t<std::invoke_result_t<Access, Row&>>;
          std::invoke(access, row) = static_cast<Value>(std::move(value));
        });
  }
  /// A value that is stored as another: `get(row)` is stored, `set(row, value)` takes it back.
  template <class Get, class Set>
  StoredRow& add(std::string key, Get get, Set set) {
    using Stored = std::remove_cvref_t<std::invoke_result_t<Get, const Row&>>;
    using Value = typename Inner<Stored>::Type;
    Field field{std::move(key), std::is_same_v<Stored, Value>};
    field.store = [get](const Row& row, const Place& place) { store(get(row), place); };
    if constexpr (std::is_arithmetic_v<Value> || std::is_enum_v<Value>) {
      field.set_number = [set](Row& row, double value) {
        set(row, Stored(static_cast<Value>(value)));
      };
    } else if constexpr (std::is_convertible_v<Value, std::string>) {
      field.set_text = [set](Row& row, std::string text) { set(row, Stored(std::move(text))); };
    } else if constexpr (std::is_same_v<Value, StoredArray>) {
      field.set_array = [set](Row& row, const StoredArray& array) { set(row, Stored(array)); };
    } else {
      field.set_array = [set](Row& row, const StoredArray& array) {
        set(row, Stored(Value(array.values.begin(), array.values.end())));
      };
    }
    fields_.push_back(std::move(field));
    return *this;
  }

  /// A value that follows from the others: stored for readers of the file, not read back.
  template <class Get>
  StoredRow& add_derived(std::string key, Get get) {
    fields_.push_back(Field{std::move(key), false, [get](const Row& row, const Place& place) {
                              store(std::invoke(get, row), place);
                            }});
    return *this;
  }

  void record(const Row& row, std::string_view series, std::int64_t item,
              Recorder& recorder) const {
    for (const Field& field : fields_) field.store(row, {recorder, series, item, field.key});
  }

  /// Rows of a list, from item 0 on.
  void record_all(const std::vector<Row>& rows, std::string_view series, Recorder& recorder) const {
    std::int64_t item = 0;
    for (const Row& row : rows) record(row, series, item++, recorder);
  }

  /// One row. Fails with kIo, naming `file`.
  [[nodiscard]] Result<Row> read(ResultsReader& reader, std::string_view series, std::int64_t item,
                                 const std::string& file) const {
    Row row{};
    for (const Field& field : fields_) {
      SIDESTEP_TRY(read_field(field, reader, series, item, file, row));
    }
    return row;
  }
  /// Every row of a series that has a number, these in one pass.
  [[nodiscard]] Result<Rows> read_all(ResultsReader& reader, std::string_view series,
                                      const std::string& file) const {
    Rows rows;
    std::vector<std::ptrdiff_t> found;  // required numbers of each
    const auto take = [&](std::int64_t item, std::string_view key, double value) {
      if (rows.empty() || rows.back().first != item) {
        rows.emplace_back(item, Row{});
        found.push_back(0);
      }
      const auto field = std::ranges::find(fields_, key, &Field::key);
      if (field == fields_.end() || !field->set_number) return;
      field->set_number(rows.back().second, value);
      found.back() += field->is_required;
    };
    SIDESTEP_TRY(reader.visit(series, take));
    const auto required = std::ranges::count_if(
        fields_, [](const Field& field) { return field.set_number && field.is_required; });
    for (std::size_t r = 0; r < rows.size(); ++r) {
      auto& [item, row] = rows[r];
      if (found[r] != required) return missing(series, "item " + std::to_string(item), file);
      for (const Field& field : fields_) {
        if (field.set_number) continue;
        SIDESTEP_TRY(read_field(field, reader, series, item, file, row));
      }
    }
    return rows;
  }

 private:
  struct Place {
    Recorder& recorder;
    std::string_view series;
    std::int64_t item;
    std::string_view key;
  };
  struct Field {
    std::string key;
    bool is_required = false;
    std::function<void(const Row&, const Place&)> store = {};
    // One of these; none where it is not read back.
    std::function<void(Row&, double)> set_number = {};
    std::function<void(Row&, std::string)> set_text = {};
    std::function<void(Row&, const StoredArray&)> set_array = {};
  };

  /// Type: of what an optional holds; else of the value itself.
  template <class Stored>
  struct Inner {
    using Type = Stored;
  };
  template <class Value>
  struct Inner<std::optional<Value>> {
    using Type = Value;
  };

  template <class Value>
  static void store(const Value& value, const Place& place) {
    if constexpr (std::is_arithmetic_v<Value>) {
      place.recorder.add(place.series, place.item, place.key, value);
    } else if constexpr (std::is_enum_v<Value>) {
      store(static_cast<int>(value), place);
    } else if constexpr (std::is_convertible_v<Value, std::string_view>) {
      place.recorder.add(place.series, place.item, place.key, std::string_view(value));
    } else if constexpr (std::is_same_v<Value, StoredArray>) {
      if (value.columns > 0) place.recorder.add(place.series, place.item, place.key, value);
    } else if constexpr (requires { value.has_value(); }) {
      if (value) store(*value, place);
    } else if (!value.empty()) {
      store(StoredArray{static_cast<int>(value.size()), 1, {value.begin(), value.end()}}, place);
    }
  }

  static auto missing(std::string_view series, const std::string& what, const std::string& file) {
    return fail(ErrorCode::kIo, "these are not the results of such an experiment", file,
                "there is no '" + what + "' of '" + std::string(series) + "', or not all of it");
  }

  [[nodiscard]] Result<void> read_field(const Field& field, ResultsReader& reader,
                                        std::string_view series, std::int64_t item,
                                        const std::string& file, Row& row) const {
    const auto take = [&](const auto& read, const auto& set) -> Result<void> {
      if (!read) return error_of(read);
      if (!*read && field.is_required && !field.set_array) return missing(series, field.key, file);
      if (*read) set(row, **read);
      return {};
    };
    if (field.set_array) return take(reader.array(series, item, field.key), field.set_array);
    if (field.set_text) return take(reader.text(series, item, field.key), field.set_text);
    if (field.set_number) return take(reader.number(series, item, field.key), field.set_number);
    return {};
  }

  std::vector<Field> fields_;
};

}  // namespace sidestep
