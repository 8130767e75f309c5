// Method:     SQLite in WAL mode with synchronous=FULL: every commit is synced before it returns.
// Source:     sqlite.org: wal.html, pragma.html, rescode.html.
#include "jobs/store/registry/database.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <cstring>

#include "jobs/store/files.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"

namespace carillon::registry {
namespace {

constexpr int kBusyMs = 60'000;

}  // namespace

Database::Database(const std::filesystem::path& file) : file_(file) {
  const int code = sqlite3_open_v2(file.c_str(), &handle_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX, nullptr);
  try {
    if (code != SQLITE_OK) fail(code);
    sqlite3_extended_result_codes(handle_, 1);
    sqlite3_busy_timeout(handle_, kBusyMs);
    Statement mode(*this, "pragma journal_mode = wal");
    if (!mode.step() || mode.text(0) != "wal")
      throw SystemError(fmt::format("{}: SQLite cannot use a write-ahead log here (journal mode \"{}\"); keep the store on a local disk",
                                    file.string(), mode.text(0)));
    run("pragma synchronous = full");
  } catch (...) {
    sqlite3_close_v2(handle_);
    throw;
  }
}

Database::Database() : file_("registry in memory") {
  if (const int code = sqlite3_open_v2(":memory:", &handle_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX, nullptr); code != SQLITE_OK) {
    sqlite3_close_v2(handle_);
    handle_ = nullptr;
    fail(code);
  }
}

Database::~Database() { sqlite3_close_v2(handle_); }

void Database::run(const char* sql) {
  const int code = sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) fail(code);
}

void Database::fail(int code) const {
  std::string what = fmt::format("{}: {}", file_.string(), handle_ != nullptr ? sqlite3_errmsg(handle_) : sqlite3_errstr(code));
  // A full disk gives many codes (no log, no shared memory); a full quota only errno.
  const int number = handle_ != nullptr ? sqlite3_system_errno(handle_) : 0;
  const bool is_refused = (code & 0xFF) == SQLITE_IOERR && base::is_full_error(number);
  if (is_refused) what += fmt::format(" ({})", std::strerror(number));
  const bool is_full = is_refused || (file_.has_parent_path() && store::is_disk_full(file_.parent_path()));
  if (is_full && (code & 0xFF) != SQLITE_FULL && (code & 0xFF) != SQLITE_BUSY && (code & 0xFF) != SQLITE_CORRUPT &&
      (code & 0xFF) != SQLITE_NOTADB)
    throw DiskFullError(fmt::format("{}; {}", what, store::kFullAdvice));
  switch (code & 0xFF) {
    case SQLITE_FULL:
      throw DiskFullError(fmt::format("{}; {}", what, store::kFullAdvice));
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      throw SystemError(what + " by another process for a minute; find that process, and try again");
    case SQLITE_IOERR:
      throw SystemError(fmt::format("{} ({}); check the disk and the room on it", what, sqlite3_errstr(code)));
    case SQLITE_NOMEM:
      throw SystemError(what + "; close other programs");
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_AUTH:
      throw SystemError(what + "; check owner, group and rights of the store");
    case SQLITE_READONLY:
      if (::access(file_.c_str(), W_OK) != 0) throw SystemError(what + "; check owner, group and rights of the store");
      throw Damaged(what);
    default:
      throw Damaged(what);
  }
}

Statement::Statement(const Database& database, const char* sql) : database_(database) {
  const int code = sqlite3_prepare_v2(database.get(), sql, -1, &handle_, nullptr);
  if (code != SQLITE_OK) database.fail(code);
}

Statement::~Statement() { sqlite3_finalize(handle_); }

Statement& Statement::check(int code) {
  if (code != SQLITE_OK) database_.fail(code);
  return *this;
}

Statement& Statement::bind(std::string_view text) {
  return check(sqlite3_bind_text(handle_, next_++, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT));
}

Statement& Statement::bind(double value) { return check(sqlite3_bind_double(handle_, next_++, value)); }

bool Statement::step() {
  const int code = sqlite3_step(handle_);
  if (code == SQLITE_ROW) return true;
  if (code != SQLITE_DONE) database_.fail(code);
  return false;
}

std::string Statement::text(int column) const {
  const auto* bytes = reinterpret_cast<const char*>(sqlite3_column_text(handle_, column));
  if (bytes == nullptr) throw Damaged("a text is missing");  // also for a damaged overflow page
  return {bytes, static_cast<std::size_t>(sqlite3_column_bytes(handle_, column))};
}

Transaction::Transaction(Database& database) : database_(database) { database.run("begin immediate"); }

Transaction::~Transaction() {
  if (is_open_) sqlite3_exec(database_.get(), "rollback", nullptr, nullptr, nullptr);
}

void Transaction::commit() {
  database_.run("commit");
  is_open_ = false;
}

}  // namespace carillon::registry
