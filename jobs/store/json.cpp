#include "jobs/store/json.hpp"

#include <sstream>

namespace carillon::store {

std::optional<Json::Value> parse_json(const std::string& text) {
  Json::Value root;
  std::istringstream stream(text);
  std::string errors;
  try {
    if (Json::parseFromStream(Json::CharReaderBuilder(), stream, &root, &errors)) return root;
  } catch (const Json::Exception&) {  // too deep
  }
  return std::nullopt;
}

std::string write_json(const Json::Value& value, const char* indentation) {
  Json::StreamWriterBuilder writer;
  writer["indentation"] = indentation;
  writer["precision"] = 17;
  writer["emitUTF8"] = true;
  writer["commentStyle"] = "None";
  return Json::writeString(writer, value);
}

}  // namespace carillon::store
