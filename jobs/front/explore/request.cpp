// Source:     RFC 9110 (semantics: 14.1 and 14.2 ranges), RFC 9112 (message syntax: 3 request line, 5 headers, 9.3 persistence).
// Deviations: targets in absolute form ("GET http://...") are refused.
#include "jobs/front/explore/request.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>

#include "jobs/front/explore/recut.hpp"
#include "runtime/base/percent.hpp"

namespace carillon::explore {
namespace {

std::string make_lower(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

std::string_view trim(std::string_view text) {
  const auto begin = text.find_first_not_of(" \t");
  return begin == std::string_view::npos ? std::string_view() : text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

/// Removes and returns the text before the separator; removes the separator too.
std::string_view take(std::string_view& text, char separator) {
  const auto end = std::min(text.find(separator), text.size());
  const std::string_view first = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  return first;
}

/// A decimal number; none for other characters and on overflow.
std::optional<std::uint64_t> parse_count(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// The path of a target, percent encoding decoded; empty for an invalid path.
std::string decode_path(std::string_view target) {
  target = target.substr(0, target.find_first_of("?#"));
  const std::string path = base::decode_percent(target).value_or("");
  return path.starts_with('/') ? path : std::string();
}

}  // namespace

FileRequest parse_request(std::string_view head) {
  FileRequest request;
  const auto refuse = [&](int status) {
    request.status = status;
    request.is_reusable = false;
    return request;
  };
  const auto take_line = [&] {
    std::string_view line = take(head, '\n');
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    return line;
  };
  std::string_view line = take_line();
  const std::string_view method = take(line, ' '), target = take(line, ' ');
  request.path = decode_path(target);
  if (request.path.empty()) return refuse(400);
  if (line != "HTTP/1.1" && line != "HTTP/1.0") return refuse(line.substr(0, 5) == "HTTP/" ? 505 : 400);
  request.is_reusable = line == "HTTP/1.1";
  int hosts = 0;
  std::string type;
  std::optional<std::uint64_t> length;
  while (!head.empty()) {
    std::string_view value = take_line();
    const std::size_t colon = value.find(':');
    if (colon == std::string_view::npos || value.substr(0, colon).find_first_of(" \t") != std::string_view::npos) return refuse(400);
    const std::string name = make_lower(take(value, ':'));
    value = trim(value);
    if (name == "host") {
      request.host = value;
      ++hosts;
    } else if (name == "range") {
      request.range = value;
    } else if (name == "connection") {
      request.is_reusable = request.is_reusable && make_lower(value).find("close") == std::string::npos;
    } else if (name == "transfer-encoding" || (name == "content-length" && value != "0")) {
      request.is_reusable = false;
    }
    if (name == "content-type") type = make_lower(value.substr(0, value.find(';')));
    if (name == "content-length") length = parse_count(value);
  }
  if (hosts > 1) return refuse(400);
  request.is_post = method == "POST" && request.path == kRecutPath;
  if (request.is_post) {
    if (!length) return refuse(411);
    if (*length > kMaxRecutBytes) return refuse(413);
    if (trim(type) != "application/json") return refuse(415);
    request.length = *length;
    request.is_reusable = false;
    return request;
  }
  request.is_head = method == "HEAD";
  if (!request.is_head && method != "GET") return refuse(405);
  return request;
}

Part find_part(std::string_view range, std::uint64_t size) {
  const Part whole{200, 0, size}, none{416, 0, 0};
  if (make_lower(range.substr(0, 6)) != "bytes=") return whole;
  std::string_view end = trim(range.substr(6));
  if (end.find('-') == std::string_view::npos) return whole;
  const std::string_view begin = trim(take(end, '-'));
  end = trim(end);
  const auto first = parse_count(begin), last = parse_count(end);
  if ((!begin.empty() && !first) || (!end.empty() && !last) || (!first && !last)) return whole;
  if (!first) return *last == 0 || size == 0 ? none : Part{206, size - std::min(*last, size), std::min(*last, size)};
  if (last && *last < *first) return whole;
  if (*first >= size) return none;
  return {206, *first, (last ? std::min(*last, size - 1) : size - 1) - *first + 1};
}

}  // namespace carillon::explore
