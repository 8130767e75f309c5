// Method:     every value is asked for by name and kind; what is not of that kind is not there.
// Source:     none.
// Deviations: none.
#include "jobs/front/report/record.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>

#include "runtime/base/file.hpp"

namespace carillon::report {
namespace {

constexpr std::uint64_t kMaxBytes = 64 << 20;
constexpr Json::ArrayIndex kMaxTexts = 50;
constexpr double kMaxCount = 9e15;  // below 2^53

}  // namespace

Json::Value parse_json(std::string_view text) {
  Json::CharReaderBuilder builder;
  builder["stackLimit"] = 64;
  builder["failIfExtra"] = true;
  const std::unique_ptr<Json::CharReader> reader(builder.newCharReader());
  Json::Value value;
  std::string errors;
  try {
    if (reader->parse(text.data(), text.data() + text.size(), &value, &errors)) return value;
  } catch (const Json::Exception&) {  // jsoncpp throws where it is nested too deep
  }
  return {};
}

const Json::Value& find(const Json::Value& in, const char* key) {
  return in.isObject() && in.isMember(key) ? in[key] : Json::Value::nullSingleton();
}

std::optional<double> find_number(const Json::Value& in, const char* key) {
  const Json::Value& value = find(in, key);
  if (!value.isNumeric() || !std::isfinite(value.asDouble())) return std::nullopt;
  return value.asDouble();
}

std::optional<double> find_amount(const Json::Value& in, const char* key) {
  const std::optional<double> value = find_number(in, key);
  return value && *value >= 0.0 ? value : std::nullopt;
}

std::optional<std::int64_t> find_count(const Json::Value& in, const char* key) {
  const std::optional<double> value = find_amount(in, key);
  if (!value || *value > kMaxCount || *value != std::floor(*value)) return std::nullopt;
  return static_cast<std::int64_t>(*value);
}

std::optional<std::string> find_text(const Json::Value& in, const char* key) {
  const Json::Value& value = find(in, key);
  if (!value.isString()) return std::nullopt;
  return value.asString();
}

std::vector<std::string> find_texts(const Json::Value& list) {
  std::vector<std::string> texts;
  for (Json::ArrayIndex i = 0; list.isArray() && i < std::min(list.size(), kMaxTexts); ++i)
    if (list[i].isString() && std::find(texts.begin(), texts.end(), list[i].asString()) == texts.end()) texts.push_back(list[i].asString());
  return texts;
}

Record read_record(const std::filesystem::path& resolved_job, const std::string& provenance) {
  Record record;
  if (!resolved_job.empty()) {
    try {
      record.job = parse_json(base::read_file(resolved_job, "resolved job", kMaxBytes));
      if (!record.job.isObject()) record.remarks.emplace_back("The file of the resolved job is no JSON object.");
    } catch (const InputError&) {
      record.remarks.emplace_back("The file of the resolved job cannot be read.");
    }
  }
  if (!find(record.job, "run").isObject()) {
    if (record.job.isObject()) record.remarks.emplace_back("The file of the resolved job holds no record of the run.");
    Json::Value own = parse_json(provenance);
    if (!record.job.isObject() && own.isObject()) record.job = own;
    record.run = find(own, "run");
    if (!resolved_job.empty() && record.run.isObject()) record.remarks.emplace_back("The bank's own copy of the record is shown.");
  } else {
    record.run = record.job["run"];
  }
  if (!record.job.isObject()) record.job = Json::Value();
  if (!record.run.isObject()) record.run = Json::Value();
  return record;
}

}  // namespace carillon::report
