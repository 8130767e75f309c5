// Percent encoding of URIs.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace carillon::base {

/// Decoded URI (RFC 3986, 2.1); nullopt for an invalid escape or a zero byte.
std::optional<std::string> decode_percent(std::string_view uri);

}  // namespace carillon::base
