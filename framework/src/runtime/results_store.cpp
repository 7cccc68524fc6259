#include <sidestep/runtime/results_store.hpp>

#include <cmath>
#include <new>
#include <system_error>

#include <sqlite3.h>

#include <sidestep/runtime/sqlite.hpp>

namespace sidestep {
namespace {

using Mode = SqliteDatabase::Mode;

constexpr const char* kName = "the results";
constexpr const char* kNotOurs = "not a results file of Sidestep";

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
  SqliteDatabase database{kName};
  SqliteStatement insert;
  SqliteStatement insert_array;

  ~Impl() {
    insert.reset();
    insert_array.reset();
    // Leaves one file behind instead of three. An error without memory for its text is none here.
    try {
      if (database.is_open()) (void)database.execute("COMMIT; PRAGMA journal_mode = DELETE;");
    } catch (const std::bad_alloc&) {
    }
  }
  template <class Value>
  Result<void> add(std::string_view series, std::int64_t item, std::string_view key, Value value) {
    SqliteQuery query(insert);
    query.bind(series).bind(item).bind(key).bind(value);
    return database.run(query);
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
  SqliteDatabase& database = store->impl_->database;
  auto done = database.open(file, Mode::kCreate);
  if (done) done = database.execute(kTables);
  if (done) done = database.execute(kBegin);
  if (!done) return error_of(done);

  SIDESTEP_TRY(store->prepare());
  auto insert_provenance =
      SIDESTEP_TRY(database.prepare("INSERT INTO provenance VALUES (?, ?)", kNotOurs));

  const std::pair<std::string_view, std::string> rows[] = {
      {"configuration", provenance.configuration},
      {"version", provenance.version},
      {"git_hash", provenance.git_hash},
      {"build_flags", provenance.build_flags},
      {"cpu", provenance.cpu},
      {"threads", std::to_string(provenance.threads)},
      {"seed", std::to_string(provenance.seed)}};
  for (const auto& [key, value] : rows) {
    SqliteQuery query(insert_provenance);
    query.bind(key).bind(std::string_view(value));
    SIDESTEP_TRY(database.run(query));
  }
  return store;
}

Result<std::unique_ptr<ResultsStore>> ResultsStore::reopen(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) {
    return fail(ErrorCode::kNotFound, "there are no results here", file.string());
  }
  std::unique_ptr<ResultsStore> store(new ResultsStore());
  SqliteDatabase& database = store->impl_->database;
  auto done = database.open(file, Mode::kWrite);
  if (done) done = store->prepare();
  if (done) done = database.execute(kBegin);
  if (!done) return error_of(done);
  return store;
}

Result<void> ResultsStore::prepare() {
  const SqliteDatabase& database = impl_->database;
  impl_->insert = SIDESTEP_TRY(
      database.prepare("INSERT OR REPLACE INTO measurements VALUES (?, ?, ?, ?)", kNotOurs));
  impl_->insert_array = SIDESTEP_TRY(
      database.prepare("INSERT OR REPLACE INTO arrays VALUES (?, ?, ?, ?, ?, ?)", kNotOurs));
  return {};
}

Result<void> ResultsStore::add(std::string_view series, std::int64_t item, std::string_view key,
                               double value) {
  // SQLite turns a NaN into NULL, which the schema refuses; its name reads back as NaN.
  if (std::isnan(value)) return impl_->add(series, item, key, std::string_view("nan"));
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
  SqliteQuery query(impl_->insert_array);
  query.bind(series).bind(item).bind(key).bind(std::int64_t{array.rows});
  query.bind(std::int64_t{array.columns}).bind(std::span(array.values));
  return impl_->database.run(query);
}

Result<void> ResultsStore::absorb(const std::filesystem::path& file, std::string_view but_series) {
  const SqliteDatabase& database = impl_->database;
  SIDESTEP_TRY(ResultsReader::open(file));  // else SQLite would make an empty one
  const auto run = [&](const char* sql, std::string_view parameter) -> Result<void> {
    const SqliteStatement statement = SIDESTEP_TRY(database.prepare(sql, kNotOurs));
    SqliteQuery query(statement);
    query.bind(parameter);
    return database.run(query);
  };
  SIDESTEP_TRY(database.execute("COMMIT"));
  SIDESTEP_TRY(run("ATTACH ? AS other", file.native()));
  SIDESTEP_TRY(database.execute("BEGIN"));
  for (const char* sql :
       {"INSERT OR REPLACE INTO measurements SELECT * FROM other.measurements WHERE series <> ?",
        "INSERT OR REPLACE INTO arrays SELECT * FROM other.arrays WHERE series <> ?"}) {
    SIDESTEP_TRY(run(sql, but_series));
  }
  return database.execute("COMMIT; DETACH other; BEGIN");
}

Result<void> ResultsStore::commit() { return impl_->database.execute("COMMIT; BEGIN;"); }

namespace {

/// Whether a query has one more row.
Result<bool> has_row(SqliteQuery& query, const SqliteDatabase& database) {
  const int status = query.step();
  if (status == SQLITE_ROW || status == SQLITE_DONE) return status == SQLITE_ROW;
  return tl::make_unexpected(database.error("cannot read the results"));
}

/// Takes back what a process that was killed had begun, which a reader is not allowed to.
void roll_back(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::exists(file.string() + "-journal", ignored)) return;
  SqliteDatabase database(kName);
  if (database.open(file, Mode::kWrite)) (void)database.execute("SELECT 1 FROM sqlite_master");
}

}  // namespace

struct ResultsReader::Impl {
  SqliteDatabase database{kName};
  SqliteStatement column, series, value, array, array_items;
};

ResultsReader::ResultsReader() : impl_(std::make_unique<Impl>()) {}
ResultsReader::~ResultsReader() = default;

Result<std::unique_ptr<ResultsReader>> ResultsReader::open(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) {
    return fail(ErrorCode::kNotFound, "there are no results here", file.string());
  }
  roll_back(file);
  std::unique_ptr<ResultsReader> reader(new ResultsReader());
  Impl& impl = *reader->impl_;
  SIDESTEP_TRY(impl.database.open(file, Mode::kRead));
  const std::pair<SqliteStatement*, const char*> statements[] = {
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
    *into = SIDESTEP_TRY(impl.database.prepare(sql, kNotOurs));
  }
  return reader;
}

Result<std::vector<double>> ResultsReader::column(std::string_view series, std::string_view key) {
  SqliteQuery query(impl_->column);
  query.bind(series).bind(key);
  std::vector<double> values;
  while (SIDESTEP_TRY(has_row(query, impl_->database))) values.push_back(query.number(0));
  return values;
}

Result<void> ResultsReader::visit(std::string_view series, const Visitor& visitor) {
  SqliteQuery query(impl_->series);
  query.bind(series);
  while (SIDESTEP_TRY(has_row(query, impl_->database))) {
    visitor(query.integer(0), query.view(1), query.number(2));
  }
  return {};
}

Result<std::optional<std::string>> ResultsReader::text(std::string_view series, std::int64_t item,
                                                       std::string_view key) {
  SqliteQuery query(impl_->value);
  query.bind(series).bind(item).bind(key);
  if (!SIDESTEP_TRY(has_row(query, impl_->database)) || !query.is_text(0)) return std::nullopt;
  return query.text(0);
}

Result<std::optional<double>> ResultsReader::number(std::string_view series, std::int64_t item,
                                                    std::string_view key) {
  SqliteQuery query(impl_->value);
  query.bind(series).bind(item).bind(key);
  if (!SIDESTEP_TRY(has_row(query, impl_->database))) return std::nullopt;
  return query.number(0);
}

Result<std::vector<std::int64_t>> ResultsReader::array_items(std::string_view series,
                                                             std::string_view key) {
  SqliteQuery query(impl_->array_items);
  query.bind(series).bind(key);
  std::vector<std::int64_t> items;
  while (SIDESTEP_TRY(has_row(query, impl_->database))) items.push_back(query.integer(0));
  return items;
}

Result<std::optional<StoredArray>> ResultsReader::array(std::string_view series, std::int64_t item,
                                                        std::string_view key) {
  SqliteQuery query(impl_->array);
  query.bind(series).bind(item).bind(key);
  if (!SIDESTEP_TRY(has_row(query, impl_->database))) return std::nullopt;
  StoredArray array;
  array.rows = static_cast<int>(query.integer(0));
  array.columns = static_cast<int>(query.integer(1));
  array.values = query.floats(2);
  if (array.rows < 0 || array.columns < 0 ||
      array.values.size() !=
          static_cast<std::size_t>(array.rows) * static_cast<std::size_t>(array.columns)) {
    return fail(ErrorCode::kIo, "an array is damaged", impl_->database.file());
  }
  return array;
}

}  // namespace sidestep
