#include <sidestep/runtime/sqlite.hpp>

#include <cmath>
#include <cstring>

#include <sqlite3.h>

#include <sidestep/core/index.hpp>

namespace sidestep {

void FinalizeStatement::operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }

SqliteQuery::~SqliteQuery() {
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

SqliteQuery& SqliteQuery::bind(std::nullptr_t) {
  sqlite3_bind_null(statement_, ++bound_);
  return *this;
}

SqliteQuery& SqliteQuery::bind(std::string_view text) {
  sqlite3_bind_text(statement_, ++bound_, text.data(), static_cast<int>(text.size()),
                    SQLITE_TRANSIENT);
  return *this;
}

SqliteQuery& SqliteQuery::bind(std::int64_t value) {
  sqlite3_bind_int64(statement_, ++bound_, value);
  return *this;
}

SqliteQuery& SqliteQuery::bind(double value) {
  sqlite3_bind_double(statement_, ++bound_, value);
  return *this;
}

SqliteQuery& SqliteQuery::bind(std::span<const float> values) {
  sqlite3_bind_blob64(statement_, ++bound_,
                      values.empty() ? "" : static_cast<const void*>(values.data()),
                      values.size_bytes(), SQLITE_TRANSIENT);
  return *this;
}

int SqliteQuery::step() { return sqlite3_step(statement_); }

bool SqliteQuery::is_text(int column) const {
  return sqlite3_column_type(statement_, column) == SQLITE_TEXT;
}

double SqliteQuery::number(int column) const {
  return is_text(column) ? std::nan("") : sqlite3_column_double(statement_, column);
}

std::int64_t SqliteQuery::integer(int column) const {
  return sqlite3_column_int64(statement_, column);
}

std::string_view SqliteQuery::view(int column) const {
  const auto* data = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
  if (data == nullptr) return {};
  return {data, idx(sqlite3_column_bytes(statement_, column))};
}

std::vector<float> SqliteQuery::floats(int column) const {
  const std::size_t bytes = idx(sqlite3_column_bytes(statement_, column));
  std::vector<float> values(bytes / sizeof(float));
  if (!values.empty()) {
    std::memcpy(values.data(), sqlite3_column_blob(statement_, column),
                values.size() * sizeof(float));
  }
  return values;
}

void SqliteDatabase::Close::operator()(sqlite3* database) const { sqlite3_close(database); }

Error SqliteDatabase::error(const std::string& failure) const {
  return Error{
      ErrorCode::kIo, failure + ": " + sqlite3_errmsg(database_.get()), file_, {}, nullptr};
}

Result<void> SqliteDatabase::open(const std::filesystem::path& file, Mode mode) {
  file_ = file.string();
  const int flags = mode == Mode::kRead    ? SQLITE_OPEN_READONLY
                    : mode == Mode::kWrite ? SQLITE_OPEN_READWRITE
                                           : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
  sqlite3* raw = nullptr;
  const int status = sqlite3_open_v2(file_.c_str(), &raw, flags, nullptr);
  database_.reset(raw);
  if (status != SQLITE_OK) return tl::make_unexpected(error("cannot open " + name_));
  return {};
}

Result<void> SqliteDatabase::execute(const char* sql) const {
  if (sqlite3_exec(database_.get(), sql, nullptr, nullptr, nullptr) != SQLITE_OK) {
    return tl::make_unexpected(error("cannot write " + name_));
  }
  return {};
}

Result<SqliteStatement> SqliteDatabase::prepare(const std::string& sql,
                                                const std::string& failure) const {
  sqlite3_stmt* raw = nullptr;
  if (sqlite3_prepare_v2(database_.get(), sql.c_str(), -1, &raw, nullptr) != SQLITE_OK) {
    return tl::make_unexpected(error(failure));
  }
  return SqliteStatement(raw);
}

Result<void> SqliteDatabase::run(SqliteQuery& query) const {
  if (query.step() != SQLITE_DONE) return tl::make_unexpected(error("cannot write " + name_));
  return {};
}

std::int64_t SqliteDatabase::last_id() const { return sqlite3_last_insert_rowid(database_.get()); }

}  // namespace sidestep
