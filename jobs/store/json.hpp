// JSON text from and to values, for jobs and requests.
#pragma once

#include <json/json.h>

#include <optional>
#include <string>

namespace carillon::store {

/// None for invalid or too deeply nested JSON.
std::optional<Json::Value> parse_json(const std::string& text);
/// Numbers with 17 digits (exact); no comments. indentation "": one line.
std::string write_json(const Json::Value& value, const char* indentation);

}  // namespace carillon::store
