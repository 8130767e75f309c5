// Files of the page's folder.
#pragma once

#include <json/json.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::explore {

/// Letters, digits, dots, "_" and "-": what is harmless in the name of a file and in an address. Never empty, no dot at its beginning.
std::string make_name(std::string_view text);

/// Null for text that is no JSON. Comments are allowed.
Json::Value parse_json(std::string_view text);
/// With all digits of numbers, on many lines.
std::string to_text(const Json::Value& value);

/// Throw SystemError when the disk refuses.
void put_file(const std::filesystem::path& from, const std::filesystem::path& to);
void put_folder(const std::filesystem::path& from, const std::filesystem::path& to);
/// `file` becomes `file`.gz.
void compress_file(const std::filesystem::path& file);
std::uintmax_t calc_bytes(const std::filesystem::path& folder);

/// A folder that appears whole or not at all: it is filled under another name next to its place, and renamed by commit().
class WholeFolder {
 public:
  /// Throws SystemError where none can be made.
  explicit WholeFolder(std::filesystem::path place);
  ~WholeFolder();
  WholeFolder(const WholeFolder&) = delete;
  WholeFolder& operator=(const WholeFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// What stands at its place is removed. Throws SystemError.
  void commit();

 private:
  std::filesystem::path place_, path_;
  std::vector<std::filesystem::path> made_;  // folders above it that were not there, innermost first: they go with it
};

}  // namespace carillon::explore
