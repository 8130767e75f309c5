// Text of JSON from and to values, as jobs and requests have it.
#pragma once

#include <json/json.h>

#include <optional>
#include <string>

namespace carillon::store {

/// None when it is no JSON, or too deep.
std::optional<Json::Value> parse_json(const std::string& text);
/// Numbers with 17 digits, which is all of them; no comments. indentation "": one line.
std::string write_json(const Json::Value& value, const char* indentation);

}  // namespace carillon::store
