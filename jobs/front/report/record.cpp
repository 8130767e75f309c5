#include "jobs/front/report/record.hpp"

#include "runtime/base/file.hpp"

namespace carillon::report {
namespace {

constexpr std::uint64_t kMaxBytes = 64 << 20;

}  // namespace

base::Json parse_json(const std::string& text) { return base::Json::parse(text).value_or(base::Json()); }

const base::Json& find(const base::Json& in, const char* key) { return in[key]; }

std::optional<std::string> find_text(const base::Json& in, const char* key) {
  const base::Json& value = find(in, key);
  return value.is_string() ? std::optional(value.as_string()) : std::nullopt;
}

Record read_record(const std::filesystem::path& resolved_job, const std::string& provenance) {
  Record record;
  if (!resolved_job.empty()) {
    try {
      record.job = parse_json(base::read_file(resolved_job, "resolved job", kMaxBytes));
      if (!record.job.is_object()) record.remarks.emplace_back("The file of the resolved job is not a JSON object.");
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
