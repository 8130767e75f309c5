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
constexpr std::size_t kMaxTexts = 50;
constexpr double kMaxCount = 9e15;  // below 2^53

}  // namespace

base::Json parse_json(const std::string& text) { return base::Json::parse(text).value_or(base::Json()); }

const base::Json& find(const base::Json& in, const char* key) { return in[key]; }

std::optional<double> find_number(const base::Json& in, const char* key) {
  const base::Json& value = find(in, key);
  if (!value.is_number() || !std::isfinite(value.as_double())) return std::nullopt;
  return value.as_double();
}

std::optional<double> find_amount(const base::Json& in, const char* key) {
  const std::optional<double> value = find_number(in, key);
  return value && *value >= 0.0 ? value : std::nullopt;
}

std::optional<std::int64_t> find_count(const base::Json& in, const char* key) {
  const std::optional<double> value = find_amount(in, key);
  if (!value || *value > kMaxCount || *value != std::floor(*value)) return std::nullopt;
  return static_cast<std::int64_t>(*value);
}

std::optional<std::string> find_text(const base::Json& in, const char* key) {
  const base::Json& value = find(in, key);
  if (!value.is_string()) return std::nullopt;
  return value.as_string();
}

std::vector<std::string> find_texts(const base::Json& list) {
  std::vector<std::string> texts;
  for (std::size_t i = 0; list.is_array() && i < std::min(list.size(), kMaxTexts); ++i)
    if (list[i].is_string() && std::find(texts.begin(), texts.end(), list[i].as_string()) == texts.end())
      texts.push_back(list[i].as_string());
  return texts;
}

Record read_record(const std::filesystem::path& resolved_job, const std::string& provenance) {
  Record record;
  if (!resolved_job.empty()) {
    try {
      record.job = parse_json(base::read_file(resolved_job, "resolved job", kMaxBytes));
      if (!record.job.is_object()) record.remarks.emplace_back("The file of the resolved job is no JSON object.");
    } catch (const InputError&) {
      record.remarks.emplace_back("The file of the resolved job cannot be read.");
    }
  }
  if (!find(record.job, "run").is_object()) {
    if (record.job.is_object()) record.remarks.emplace_back("The file of the resolved job holds no record of the run.");
    base::Json own = parse_json(provenance);
    if (!record.job.is_object() && own.is_object()) record.job = own;
    record.run = find(own, "run");
    if (!resolved_job.empty() && record.run.is_object()) record.remarks.emplace_back("The bank's own copy of the record is shown.");
  } else {
    record.run = record.job["run"];
  }
  if (!record.job.is_object()) record.job = base::Json();
  if (!record.run.is_object()) record.run = base::Json();
  return record;
}

}  // namespace carillon::report
