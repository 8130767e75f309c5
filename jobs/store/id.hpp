// Ids: SHA-256 in hex, the names of folders and files in the store. No id can lead out of the store.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace carillon::store {

/// 64 lower-case hex digits; created only by parse_id(), require_id() and the hashes below.
class Id {
 public:
  const std::string& text() const { return text_; }
  /// The first twelve digits, for display.
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

/// SHA-256 of a regular file, in bounded memory. `what`: the kind of file for messages ("mesh"); `take`: called with every piece.
/// InputError if the file is missing, unreadable or not a regular file (never waits on a pipe or device).
Id hash_file(const std::filesystem::path& file, std::string_view what, const std::function<void(std::string_view)>& take = {});

/// 16 random bytes as 32 hex digits.
std::string make_random_name();

/// Name of an input in the store ("tetgen": of its .node file).
std::string make_input_name(const Id& sha256, const std::string& format);

}  // namespace carillon::store
