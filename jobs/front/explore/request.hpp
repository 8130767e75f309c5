// HTTP/1.1 requests for files, and those to compute a body again.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace carillon::explore {

struct FileRequest {
  int status = 200;      // HTTP status of the answer: 200, 400, 405, 411, 413, 415, 505
  bool is_post = false;  // POST to kRecutPath, followed by `length` bytes of JSON
  std::uint64_t length = 0;
  bool is_head = false;     // HEAD: answer without a body
  bool is_reusable = true;  // keep-alive
  std::string path;         // decoded, without the query; begins with "/"
  std::string host;
  std::string range;  // value of the header; empty: none
};

/// Parses request line and headers, without the final empty line. A request with a body is not reusable:
/// the body of a GET is never read. POST requests must be JSON, which pages of other origins cannot send unasked (Fetch standard, CORS).
FileRequest parse_request(std::string_view head);

/// A range of bytes of a file.
struct Part {
  int status = 200;  // 206: a part; 416: none
  std::uint64_t begin = 0, length = 0;
};

/// Parses the value of a Range header. Several ranges and invalid ones give the whole file (RFC 9110 14.2).
Part find_part(std::string_view range, std::uint64_t size);

}  // namespace carillon::explore
