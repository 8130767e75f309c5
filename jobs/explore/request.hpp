// Requests of HTTP/1.1 as a server of files takes them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace carillon::explore {

struct FileRequest {
  int status = 200;         // else what refuses it: 400, 405, 505
  bool is_head = false;     // HEAD: the answer has no body
  bool is_reusable = true;  // whether its connection may carry another one
  std::string path;         // decoded, without what follows "?"; begins with "/"
  std::string host;
  std::string range;  // value of the header; empty: none
};

/// Reads request line and headers, without the empty line that ends them. A request with a body is not reusable: the body is never read.
FileRequest parse_request(std::string_view head);

/// Which bytes of a file are sent.
struct Part {
  int status = 200;  // 206: a part; 416: none
  std::uint64_t begin = 0, length = 0;
};

/// Of the value of a Range header. One range is served; several, and what is no range, give the whole file, as RFC 9110 14.2 allows.
Part find_part(std::string_view range, std::uint64_t size);

}  // namespace carillon::explore
