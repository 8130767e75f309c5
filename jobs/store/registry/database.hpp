// SQLite connections, statements and transactions, with errors as exceptions.
#pragma once

#include <sqlite3.h>

#include <concepts>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

namespace carillon::registry {

/// The file is not a usable registry: remove it and rebuild it from the store.
class Damaged : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// One connection to SQLite. Every error is thrown as Damaged or SystemError.
class Database {
 public:
  /// Opens an existing file: WAL, synchronous=FULL, waits for other writers up to a minute.
  explicit Database(const std::filesystem::path& file);
  /// An empty database in memory.
  Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;
  ~Database();

  void run(const char* sql);
  sqlite3* get() const { return handle_; }
  /// Throws Damaged or SystemError for `code`, an error of SQLite.
  [[noreturn]] void fail(int code) const;

 private:
  sqlite3* handle_ = nullptr;
  std::filesystem::path file_;
};

/// One prepared statement: bind in order, then step().
class Statement {
 public:
  Statement(const Database& database, const char* sql);
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  ~Statement();

  Statement& bind(std::string_view text);
  Statement& bind(double value);
  Statement& bind(std::integral auto value) { return check(sqlite3_bind_int64(handle_, next_++, static_cast<sqlite3_int64>(value))); }
  /// True while there is a row.
  bool step();

  std::string text(int column) const;
  long long integer(int column) const { return sqlite3_column_int64(handle_, column); }
  double number(int column) const { return sqlite3_column_double(handle_, column); }

 private:
  Statement& check(int code);
  const Database& database_;
  sqlite3_stmt* handle_ = nullptr;
  int next_ = 1;
};

/// A write transaction, rolled back unless commit() was called. Waits for other writers.
class Transaction {
 public:
  explicit Transaction(Database& database);
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  ~Transaction();
  void commit();

 private:
  Database& database_;
  bool is_open_ = true;
};

}  // namespace carillon::registry
