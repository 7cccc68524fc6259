#include <sidestep/runtime/results_store.hpp>

#include <cmath>
#include <cstring>
#include <system_error>

#include <sqlite3.h>

namespace sidestep {
namespace {

// SQLiteCpp throws where these return a Result, so every call would need a handler. What is written
// here are two owners and a query.
struct CloseDatabase {
  void operator()(sqlite3* database) const { sqlite3_close(database); }
};
struct FinalizeStatement {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Database = std::unique_ptr<sqlite3, CloseDatabase>;

/// A prepared statement with its parameters bound; ready for reuse once it is destroyed.
class Query {
 public:
  explicit Query(sqlite3_stmt* statement) : statement_(statement) {}
  ~Query() {
    sqlite3_reset(statement_);
    sqlite3_clear_bindings(statement_);
  }
  Query(const Query&) = delete;
  Query& operator=(const Query&) = delete;

  Query& bind(std::string_view text) {
    sqlite3_bind_text(statement_, ++bound_, text.data(), static_cast<int>(text.size()),
                      SQLITE_TRANSIENT);
    return *this;
  }
  Query& bind(std::int64_t value) {
    sqlite3_bind_int64(statement_, ++bound_, value);
    return *this;
  }
  Query& bind(double value) {
    // SQLite turns a NaN into NULL, which the schema refuses; its name reads back as NaN.
    if (std::isnan(value)) return bind(std::string_view("nan"));
    sqlite3_bind_double(statement_, ++bound_, value);
    return *this;
  }
  Query& bind(std::span<const float> values) {
    sqlite3_bind_blob64(statement_, ++bound_,
                        values.empty() ? "" : static_cast<const void*>(values.data()),
                        values.size_bytes(), SQLITE_TRANSIENT);
    return *this;
  }
  /// SQLITE_ROW, SQLITE_DONE or an error.
  int step() { return sqlite3_step(statement_); }

  [[nodiscard]] bool is_text(int column) const {
    return sqlite3_column_type(statement_, column) == SQLITE_TEXT;
  }
  [[nodiscard]] double number(int column) const {
    return is_text(column) ? std::nan("") : sqlite3_column_double(statement_, column);
  }
  [[nodiscard]] std::int64_t integer(int column) const {
    return sqlite3_column_int64(statement_, column);
  }
  [[nodiscard]] std::string text(int column) const {
    const auto* data = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
    return data == nullptr
               ? std::string()
               : std::string(data,
                             static_cast<std::size_t>(sqlite3_column_bytes(statement_, column)));
  }
  /// A text's bytes, valid until the next step.
  [[nodiscard]] std::string_view view(int column) const {
    const auto* data = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
    if (data == nullptr) return {};
    return {data, static_cast<std::size_t>(sqlite3_column_bytes(statement_, column))};
  }
  [[nodiscard]] std::vector<float> floats(int column) const {
    const auto bytes = static_cast<std::size_t>(sqlite3_column_bytes(statement_, column));
    std::vector<float> values(bytes / sizeof(float));
    if (!values.empty()) {
      std::memcpy(values.data(), sqlite3_column_blob(statement_, column),
                  values.size() * sizeof(float));
    }
    return values;
  }

 private:
  sqlite3_stmt* statement_;
  int bound_ = 0;
};

/// An open file and its prepared statements.
struct Connection {
  Database database;
  std::string file;

  [[nodiscard]] Error error(const std::string& doing) const {
    return Error{ErrorCode::kIo, doing + ": " + sqlite3_errmsg(database.get()), file, {}, nullptr};
  }

  [[nodiscard]] Result<void> open(const std::filesystem::path& path, int flags) {
    file = path.string();
    sqlite3* raw = nullptr;
    const int status = sqlite3_open_v2(file.c_str(), &raw, flags, nullptr);
    database.reset(raw);
    if (status != SQLITE_OK) return tl::make_unexpected(error("cannot open the results"));
    return {};
  }
  [[nodiscard]] Result<void> execute(const char* sql) const {
    if (sqlite3_exec(database.get(), sql, nullptr, nullptr, nullptr) != SQLITE_OK) {
      return tl::make_unexpected(error("cannot write the results"));
    }
    return {};
  }
  [[nodiscard]] Result<std::unique_ptr<sqlite3_stmt, FinalizeStatement>> prepare(
      const char* sql) const {
    sqlite3_stmt* raw = nullptr;
    if (sqlite3_prepare_v2(database.get(), sql, -1, &raw, nullptr) != SQLITE_OK) {
      return tl::make_unexpected(error("not a results file of Sidestep"));
    }
    return std::unique_ptr<sqlite3_stmt, FinalizeStatement>(raw);
  }
  /// Runs a query that returns no rows.
  [[nodiscard]] Result<void> run(Query& query) const {
    if (query.step() != SQLITE_DONE) {
      return tl::make_unexpected(error("cannot write the results"));
    }
    return {};
  }
};

using Statement = std::unique_ptr<sqlite3_stmt, FinalizeStatement>;

constexpr const char* kBegin = R"(
  PRAGMA journal_mode = WAL;
  PRAGMA synchronous = NORMAL;
  BEGIN;
)";

constexpr const char* kTables = R"(
  CREATE TABLE provenance (key TEXT PRIMARY KEY, value TEXT NOT NULL);
  CREATE TABLE measurements (
    series TEXT NOT NULL, item INTEGER NOT NULL, key TEXT NOT NULL, value NOT NULL,
    PRIMARY KEY (series, item, key)) WITHOUT ROWID;
  CREATE TABLE arrays (
    series TEXT NOT NULL, item INTEGER NOT NULL, key TEXT NOT NULL,
    rows INTEGER NOT NULL, columns INTEGER NOT NULL, float32 BLOB NOT NULL,
    PRIMARY KEY (series, item, key)) WITHOUT ROWID;
)";

}  // namespace

struct ResultsStore::Impl {
  Connection connection;
  Statement insert;
  Statement insert_array;

  ~Impl() {
    insert.reset();
    insert_array.reset();
    if (!connection.database) return;
    // Leaves one file behind instead of three.
    sqlite3_exec(connection.database.get(), "COMMIT; PRAGMA journal_mode = DELETE;", nullptr,
                 nullptr, nullptr);
  }
  template <class Value>
  Result<void> add(std::string_view series, std::int64_t item, std::string_view key, Value value) {
    Query query(insert.get());
    query.bind(series).bind(item).bind(key).bind(value);
    return connection.run(query);
  }
};

ResultsStore::ResultsStore() : impl_(std::make_unique<Impl>()) {}
ResultsStore::~ResultsStore() = default;

Result<std::unique_ptr<ResultsStore>> ResultsStore::open(const std::filesystem::path& file,
                                                         const RunProvenance& provenance) {
  std::error_code ignored;
  for (const char* suffix : {"", "-wal", "-shm", "-journal"}) {
    std::filesystem::remove(file.string() + suffix, ignored);
  }
  std::unique_ptr<ResultsStore> store(new ResultsStore());
  Connection& connection = store->impl_->connection;
  auto done = connection.open(file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  if (done) done = connection.execute(kTables);
  if (done) done = connection.execute(kBegin);
  if (!done) return error_of(done);

  SIDESTEP_TRY(store->prepare());
  auto insert_provenance = SIDESTEP_TRY(connection.prepare("INSERT INTO provenance VALUES (?, ?)"));

  const std::pair<std::string_view, std::string> rows[] = {
      {"configuration", provenance.configuration},
      {"version", provenance.version},
      {"git_hash", provenance.git_hash},
      {"build_flags", provenance.build_flags},
      {"cpu", provenance.cpu},
      {"threads", std::to_string(provenance.threads)},
      {"seed", std::to_string(provenance.seed)}};
  for (const auto& [key, value] : rows) {
    Query query(insert_provenance.get());
    query.bind(key).bind(std::string_view(value));
    SIDESTEP_TRY(connection.run(query));
  }
  return store;
}

Result<std::unique_ptr<ResultsStore>> ResultsStore::reopen(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) {
    return fail(ErrorCode::kNotFound, "there are no results here", file.string());
  }
  std::unique_ptr<ResultsStore> store(new ResultsStore());
  const Connection& connection = store->impl_->connection;
  auto done = store->impl_->connection.open(file, SQLITE_OPEN_READWRITE);
  if (done) done = store->prepare();
  if (done) done = connection.execute(kBegin);
  if (!done) return error_of(done);
  return store;
}

Result<void> ResultsStore::prepare() {
  const Connection& connection = impl_->connection;
  auto insert = connection.prepare("INSERT OR REPLACE INTO measurements VALUES (?, ?, ?, ?)");
  auto insert_array = connection.prepare("INSERT OR REPLACE INTO arrays VALUES (?, ?, ?, ?, ?, ?)");
  for (auto* statement : {&insert, &insert_array}) {
    if (!*statement) return error_of(*statement);
  }
  impl_->insert = std::move(*insert);
  impl_->insert_array = std::move(*insert_array);
  return {};
}

Result<void> ResultsStore::add(std::string_view series, std::int64_t item, std::string_view key,
                               double value) {
  return impl_->add(series, item, key, value);
}

Result<void> ResultsStore::add(std::string_view series, std::int64_t item, std::string_view key,
                               std::string_view text) {
  return impl_->add(series, item, key, text);
}

Result<void> ResultsStore::add(std::string_view series, std::int64_t item, std::string_view key,
                               const StoredArray& array) {
  const auto expected =
      static_cast<std::size_t>(array.rows) * static_cast<std::size_t>(array.columns);
  if (array.rows < 0 || array.columns < 0 || array.values.size() != expected) {
    return fail(ErrorCode::kInvalidArgument,
                "an array of " + std::to_string(array.rows) + " x " +
                    std::to_string(array.columns) + " has " + std::to_string(array.values.size()) +
                    " values",
                std::string(series) + "/" + std::string(key));
  }
  Query query(impl_->insert_array.get());
  query.bind(series).bind(item).bind(key).bind(std::int64_t{array.rows});
  query.bind(std::int64_t{array.columns}).bind(std::span(array.values));
  return impl_->connection.run(query);
}

Result<void> ResultsStore::commit() { return impl_->connection.execute("COMMIT; BEGIN;"); }

struct ResultsReader::Impl {
  Connection connection;
  Statement column, series, value, array, array_items;
};

ResultsReader::ResultsReader() : impl_(std::make_unique<Impl>()) {}
ResultsReader::~ResultsReader() = default;

Result<std::unique_ptr<ResultsReader>> ResultsReader::open(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) {
    return fail(ErrorCode::kNotFound, "there are no results here", file.string());
  }
  std::unique_ptr<ResultsReader> reader(new ResultsReader());
  Impl& impl = *reader->impl_;
  SIDESTEP_TRY(impl.connection.open(file, SQLITE_OPEN_READONLY));
  const std::pair<Statement*, const char*> statements[] = {
      {&impl.column,
       "SELECT value FROM measurements WHERE series = ? AND key = ? "
       "AND (typeof(value) <> 'text' OR value = 'nan') ORDER BY item"},
      {&impl.series,
       "SELECT item, key, value FROM measurements WHERE series = ? "
       "AND (typeof(value) <> 'text' OR value = 'nan') ORDER BY item, key"},
      {&impl.value, "SELECT value FROM measurements WHERE series = ? AND item = ? AND key = ?"},
      {&impl.array,
       "SELECT rows, columns, float32 FROM arrays WHERE series = ? AND item = ? AND key = ?"},
      {&impl.array_items, "SELECT item FROM arrays WHERE series = ? AND key = ? ORDER BY item"}};
  for (const auto& [into, sql] : statements) {
    *into = SIDESTEP_TRY(impl.connection.prepare(sql));
  }
  return reader;
}

Result<std::vector<double>> ResultsReader::column(std::string_view series, std::string_view key) {
  Query query(impl_->column.get());
  query.bind(series).bind(key);
  std::vector<double> values;
  int status = SQLITE_ROW;
  while ((status = query.step()) == SQLITE_ROW) values.push_back(query.number(0));
  if (status != SQLITE_DONE) {
    return tl::make_unexpected(impl_->connection.error("cannot read the results"));
  }
  return values;
}

Result<void> ResultsReader::visit(std::string_view series, const Visitor& visitor) {
  Query query(impl_->series.get());
  query.bind(series);
  int status = SQLITE_ROW;
  while ((status = query.step()) == SQLITE_ROW) {
    visitor(query.integer(0), query.view(1), query.number(2));
  }
  if (status != SQLITE_DONE) {
    return tl::make_unexpected(impl_->connection.error("cannot read the results"));
  }
  return {};
}

Result<std::optional<std::string>> ResultsReader::text(std::string_view series, std::int64_t item,
                                                       std::string_view key) {
  Query query(impl_->value.get());
  query.bind(series).bind(item).bind(key);
  if (query.step() != SQLITE_ROW || !query.is_text(0)) return std::nullopt;
  return query.text(0);
}

Result<std::optional<double>> ResultsReader::number(std::string_view series, std::int64_t item,
                                                    std::string_view key) {
  Query query(impl_->value.get());
  query.bind(series).bind(item).bind(key);
  if (query.step() != SQLITE_ROW) return std::nullopt;
  return query.number(0);
}

Result<std::vector<std::int64_t>> ResultsReader::array_items(std::string_view series,
                                                             std::string_view key) {
  Query query(impl_->array_items.get());
  query.bind(series).bind(key);
  std::vector<std::int64_t> items;
  while (query.step() == SQLITE_ROW) items.push_back(query.integer(0));
  return items;
}

Result<std::optional<StoredArray>> ResultsReader::array(std::string_view series, std::int64_t item,
                                                        std::string_view key) {
  Query query(impl_->array.get());
  query.bind(series).bind(item).bind(key);
  if (query.step() != SQLITE_ROW) return std::nullopt;
  StoredArray array;
  array.rows = static_cast<int>(query.integer(0));
  array.columns = static_cast<int>(query.integer(1));
  array.values = query.floats(2);
  if (array.values.size() !=
      static_cast<std::size_t>(array.rows) * static_cast<std::size_t>(array.columns)) {
    return fail(ErrorCode::kIo, "an array is damaged", impl_->connection.file);
  }
  return array;
}

}  // namespace sidestep
