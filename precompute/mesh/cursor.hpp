// Bounds-checked cursor over the bytes of a mesh file: text tokens and binary numbers. Internal header of the readers.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "runtime/base/error.hpp"
#include "runtime/base/includes.hpp"

namespace carillon::mesh {

/// Beginning of untrusted text, made printable, for messages.
std::string quote_excerpt(std::string_view text);

/// Cursor over the bytes of a mesh file. Reading past the end throws InputError with file and position.
class Cursor {
 public:
  Cursor(std::string_view bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}

  /// Switches to binary numbers and byte positions; `swap_bytes` for files of the other byte order.
  void set_binary(bool swap_bytes) {
    binary_ = true;
    swap_ = swap_bytes;
  }
  void set_comment(char mark) { comment_ = mark; }
  /// Files of which the text is joined, for messages; kept by the caller.
  void set_origins(std::span<const base::TextOrigin> origins) { origins_ = origins; }

  std::size_t place() const { return at_; }
  std::size_t remaining() const { return bytes_.size() - at_; }
  const std::string& name() const { return name_; }
  std::string_view bytes() const { return bytes_; }
  void seek(std::size_t place) { at_ = place; }

  /// "name:line" of a position in text.
  std::string find_place(std::size_t place) const;
  /// Throws InputError "name:line: message" or "name: byte N: message".
  template <class... Args>
  [[noreturn]] void fail(std::size_t place, fmt::format_string<Args...> format, Args&&... args) const {
    fail_text(place, fmt::format(format, std::forward<Args>(args)...));
  }
  [[noreturn]] void fail_text(std::size_t place, const std::string& message) const;

  /// Skips white space, line ends and comments; false at the end.
  bool skip_space();
  /// Consumes the rest of the line; returns it without its end (LF or CRLF).
  std::string_view line();
  /// Next word; InputError at the end. `what` names the expected item.
  std::string_view word(const char* what);

  /// Next number in the current mode (text, or binary of exactly this type).
  std::int32_t int32(const char* what) {
    return binary_ ? raw<std::int32_t>(what) : static_cast<std::int32_t>(text_int(what, INT32_MIN, INT32_MAX));
  }
  std::int64_t int64(const char* what) { return binary_ ? raw<std::int64_t>(what) : text_int(what, INT64_MIN, INT64_MAX); }
  double real(const char* what) { return binary_ ? raw<double>(what) : text_real(what); }

  /// Text in either mode (counts of binary Gmsh 2.2 are text).
  std::int64_t text_int(const char* what, std::int64_t low, std::int64_t high);
  double text_real(const char* what);

  /// Checks that `count` items of at least `min_bytes` each fit the remaining bytes, before any allocation.
  std::size_t checked_count(std::int64_t count, std::size_t min_bytes, const char* what, std::size_t place) const;

  template <class T>
  T raw(const char* what) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (remaining() < sizeof(T)) fail(at_, "the file ends where {} should be; it was cut short: write or copy it again", what);
    unsigned char copy[sizeof(T)];
    std::memcpy(copy, bytes_.data() + at_, sizeof(T));
    if (swap_)
      for (std::size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(copy[i], copy[sizeof(T) - 1 - i]);
    T value;
    std::memcpy(&value, copy, sizeof(T));
    at_ += sizeof(T);
    return value;
  }

 private:
  std::string_view bytes_;
  std::string name_;
  std::size_t at_ = 0;
  bool binary_ = false;
  bool swap_ = false;
  char comment_ = '\0';
  std::span<const base::TextOrigin> origins_;
};

}  // namespace carillon::mesh
