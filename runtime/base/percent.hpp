// Percent encoding of URIs.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace carillon::base {

/// A URI without its escapes (RFC 3986, 2.1); nothing if one is invalid or a zero byte.
std::optional<std::string> decode_percent(std::string_view uri);

}  // namespace carillon::base
