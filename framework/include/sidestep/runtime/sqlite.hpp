#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sidestep/core/error.hpp>

struct sqlite3;
struct sqlite3_stmt;

namespace sidestep {

struct FinalizeStatement {
  void operator()(sqlite3_stmt* statement) const;
};
/// A prepared statement; the database outlives it.
using SqliteStatement = std::unique_ptr<sqlite3_stmt, FinalizeStatement>;

/// A prepared statement with its parameters bound; ready for reuse once it is destroyed. [main]
class SqliteQuery {
 public:
  explicit SqliteQuery(const SqliteStatement& statement) : statement_(statement.get()) {}
  ~SqliteQuery();
  SqliteQuery(const SqliteQuery&) = delete;
  SqliteQuery& operator=(const SqliteQuery&) = delete;

  /// Binds the next parameter. NaN is stored as NULL.
  SqliteQuery& bind(std::nullptr_t);
  SqliteQuery& bind(std::string_view text);
  SqliteQuery& bind(std::int64_t value);
  SqliteQuery& bind(double value);
  SqliteQuery& bind(std::span<const float> values);
  /// SQLITE_ROW, SQLITE_DONE or an error.
  int step();

  // Of the row.
  [[nodiscard]] bool is_text(int column) const;
  [[nodiscard]] double number(int column) const;
  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] std::string text(int column) const { return std::string(view(column)); }
  /// A text's bytes, valid until the next step.
  [[nodiscard]] std::string_view view(int column) const;
  [[nodiscard]] std::vector<float> floats(int column) const;

 private:
  sqlite3_stmt* statement_;
  int bound_ = 0;
};

/// An SQLite database in a file. SQLiteCpp throws where this returns a Result, so every call would
/// need a handler. [main]
class SqliteDatabase {
 public:
  /// `name`: what the file is, for messages, e.g. "the results".
  explicit SqliteDatabase(std::string name) : name_(std::move(name)) {}

  enum class Mode { kRead, kWrite, kCreate };
  /// Fails with kIo, as all below.
  [[nodiscard]] Result<void> open(const std::filesystem::path& file, Mode mode);
  [[nodiscard]] bool is_open() const noexcept { return database_ != nullptr; }
  /// Runs statements without parameters.
  [[nodiscard]] Result<void> execute(const char* sql) const;
  /// Fails with `failure` where the statement does not fit the database.
  [[nodiscard]] Result<SqliteStatement> prepare(const std::string& sql,
                                                const std::string& failure) const;
  /// Runs a query that returns no rows.
  [[nodiscard]] Result<void> run(SqliteQuery& query) const;
  /// The id of the row that was inserted last.
  [[nodiscard]] std::int64_t last_id() const;

  /// The last failure, with what came of it.
  [[nodiscard]] Error error(const std::string& failure) const;
  [[nodiscard]] const std::string& file() const noexcept { return file_; }

 private:
  struct Close {
    void operator()(sqlite3* database) const;
  };

  std::string name_;
  std::string file_;
  std::unique_ptr<sqlite3, Close> database_;
};

}  // namespace sidestep
