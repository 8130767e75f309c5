#include "precompute/mesh/cursor.hpp"

#include <algorithm>
#include <charconv>
#include <cstdlib>

#include "runtime/base/failure.hpp"

namespace carillon::mesh {

namespace {
bool is_space(char c) { return c == ' ' || c == '\n' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }
}  // namespace

std::string quote_excerpt(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  std::string shown = "'";
  for (const char c : text.substr(0, kLongest)) shown += (c >= 32 && c < 127) ? c : '?';
  return shown + (text.size() > kLongest ? "...'" : "'");
}

std::string Cursor::find_place(std::size_t place) const { return base::find_place(bytes_, name_, origins_, place); }

void Cursor::fail_text(std::size_t place, const std::string& message) const {
  if (binary_) throw InputError(fmt::format("{}: byte {}: {}", name_, place, message));
  throw PlacedError(find_place(place), message);
}

bool Cursor::skip_space() {
  while (at_ < bytes_.size()) {
    if (is_space(bytes_[at_])) {
      ++at_;
    } else if (comment_ != '\0' && bytes_[at_] == comment_) {
      const auto end = bytes_.find('\n', at_);
      at_ = end == std::string_view::npos ? bytes_.size() : end;
    } else {
      return true;
    }
  }
  return false;
}

std::string_view Cursor::line() {
  const auto end = std::min(bytes_.find('\n', at_), bytes_.size());
  std::string_view text = bytes_.substr(at_, end - at_);
  at_ = std::min(end + 1, bytes_.size());
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

std::string_view Cursor::word(const char* what) {
  if (!skip_space()) fail(at_, "the file ends where {} should be; it was cut short: write or copy it again", what);
  const std::size_t begin = at_;
  while (at_ < bytes_.size() && !is_space(bytes_[at_]) && (comment_ == '\0' || bytes_[at_] != comment_)) ++at_;
  return bytes_.substr(begin, at_ - begin);
}

std::int64_t Cursor::text_int(const char* what, std::int64_t low, std::int64_t high) {
  std::string_view text = word(what);
  const std::string_view whole = text;
  if (text.size() > 1 && text[0] == '+') text.remove_prefix(1);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const std::size_t place = at_ - whole.size();
  if (error == std::errc::result_out_of_range || (error == std::errc{} && (value < low || value > high)))
    fail(place, "{} is {}, which lies outside {} to {}; write the mesh again", what, quote_excerpt(whole), low, high);
  if (error != std::errc{} || end != text.data() + text.size())
    fail(place, "expected {} (a whole number), found {}; a number is missing or damaged before it: write the mesh again", what,
         quote_excerpt(whole));
  return value;
}

double Cursor::text_real(const char* what) {
  std::string_view text = word(what);
  const std::string_view whole = text;
  if (text.size() > 1 && text[0] == '+') text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc::result_out_of_range && end == text.data() + text.size()) return std::strtod(std::string(text).c_str(), nullptr);
  if (error != std::errc{} || end != text.data() + text.size())
    fail(at_ - whole.size(), "expected {} (a number), found {}; a number is missing or damaged: write the mesh again", what,
         quote_excerpt(whole));
  return value;
}

std::size_t Cursor::checked_count(std::int64_t count, std::size_t min_bytes, const char* what, std::size_t place) const {
  const std::size_t max = remaining() / min_bytes + 1;
  if (count < 0 || static_cast<std::uint64_t>(count) > max)
    fail(place, "the file announces {} {}, but the {} bytes after it have room for {} at most; it was cut short or damaged: write it again",
         count, what, remaining(), max);
  return count;
}

}  // namespace carillon::mesh
