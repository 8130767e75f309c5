// Ids: SHA-256 in hex. Whatever names a folder or a file of the store is one of these, so that no path can lead out of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace carillon::store {

/// 64 lower-case hex digits; there is no other way to make one than parse_id(), require_id() and the hashes below.
class Id {
 public:
  const std::string& text() const { return text_; }
  /// The first twelve digits, for people.
  std::string short_text() const { return text_.substr(0, 12); }
  auto operator<=>(const Id&) const = default;

 private:
  friend std::optional<Id> parse_id(std::string_view text);
  explicit Id(std::string text) : text_(std::move(text)) {}
  std::string text_;
};

/// None unless `text` is 64 lower-case hex digits.
std::optional<Id> parse_id(std::string_view text);
/// The same; throws InputError "where: ..." otherwise.
Id require_id(std::string_view text, const std::string& where);

Id hash_text(std::string_view text);

/// SHA-256 of a regular file, in bounded memory. `what` says in messages what was expected ("mesh"); `take` (may be empty) sees every
/// piece. Throws InputError for what is missing, no regular file (a pipe or a device is never waited on), a loop of links or not readable.
Id hash_file(const std::filesystem::path& file, std::string_view what, const std::function<void(std::string_view)>& take = {});

/// 16 random bytes as 32 hex digits: the name of an attempt, of a temporary folder.
std::string make_random_name();

/// The name of an input in the store, of its SHA-256 and its format ("tetgen": that of the .node file).
std::string make_input_name(const Id& sha256, const std::string& format);

}  // namespace carillon::store
