#include "jobs/front/report/record.hpp"

#include <fmt/format.h>

#include <memory>

#include "runtime/base/file.hpp"

namespace carillon::report {
namespace {

constexpr std::uint64_t kMaxBytes = 64 << 20;

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
  } catch (const Json::Exception&) {  // nested too deep
  }
  return {};
}

const Json::Value& find(const Json::Value& in, const char* key) {
  return in.isObject() && in.isMember(key) ? in[key] : Json::Value::nullSingleton();
}

std::optional<std::string> find_text(const Json::Value& in, const char* key) {
  const Json::Value& value = find(in, key);
  if (!value.isString()) return std::nullopt;
  return value.asString();
}

Record read_record(const std::filesystem::path& resolved_job, const std::string& provenance) {
  Record record;
  if (!resolved_job.empty()) {
    try {
      record.job = parse_json(base::read_file(resolved_job, "resolved job", kMaxBytes));
      if (!record.job.isObject()) record.remarks.emplace_back("The file of the resolved job is not a JSON object.");
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
