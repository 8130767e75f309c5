// SQLite behind two small classes, and its errors sorted into ours.
#pragma once

#include <sqlite3.h>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

namespace carillon::registry {

/// The file is no database, or not as we wrote it: set it aside and make another.
class Damaged : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// One connection to SQLite, open as long as this exists. Every error of SQLite leaves as Damaged or SystemError.
class Database {
 public:
  /// Opens a file that exists: WAL, synchronous=FULL, waits up to a minute for others. Throws Damaged, SystemError.
  explicit Database(const std::filesystem::path& file);
  /// An empty one in memory.
  Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;
  ~Database();

  void run(const char* sql);
  sqlite3* get() const { return handle_; }
  /// Throws what `code`, an error of SQLite, means: Damaged, or SystemError with the remedy.
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
  Statement& bind(long long value);
  Statement& bind(double value);
  /// True while there is a row.
  bool step();
  /// Ready to be bound and stepped again.
  void reset();

  std::string text(int column) const;
  long long integer(int column) const { return sqlite3_column_int64(handle_, column); }
  double number(int column) const { return sqlite3_column_double(handle_, column); }

 private:
  const Database& database_;
  sqlite3_stmt* handle_ = nullptr;
  int next_ = 1;
};

/// A write transaction that is rolled back unless commit() was called. It waits for other writers.
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
