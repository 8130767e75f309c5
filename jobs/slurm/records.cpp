#include "jobs/slurm/records.hpp"

#include <algorithm>
#include <fstream>
#include <system_error>

#include "jobs/slurm/script.hpp"
#include "jobs/store/open_folder.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"

namespace carillon::slurm {
namespace {

namespace fs = std::filesystem;

constexpr const char* kNoJob = "none";
constexpr const char* kSubmittedFile = "slurm.json";
constexpr const char* kRetriesFile = "retries.json";
constexpr const char* kJobsFile = "jobs";
constexpr const char* kNumberFile = "number";
constexpr std::streamoff kMaxOutputBytes = 4096;

bool is_name(const std::string& text) { return text.size() == 32 && text.find_first_not_of("0123456789abcdef") == std::string::npos; }

}  // namespace

void write_submitted_job(const fs::path& work, const SubmittedJob& submitted) {
  base::Json root = base::Json::object();
  root.set("batch", submitted.batch).set("title", submitted.title).set("task", submitted.task);
  root.set("before", submitted.before.empty() ? kNoJob : submitted.before);
  base::write_file(work / kSubmittedFile, root.text());
}

std::optional<SubmittedJob> read_submitted_job(const fs::path& work) {
  std::error_code error;
  if (!fs::exists(work / kSubmittedFile, error)) return std::nullopt;
  try {
    base::Object root = base::read_document(work / kSubmittedFile).root();
    SubmittedJob submitted;
    submitted.batch = root.string("batch");
    submitted.title = root.string("title");
    submitted.task = static_cast<int>(root.integer("task", -1, 1 << 30));
    submitted.before = root.string("before");
    if (submitted.before == kNoJob) submitted.before.clear();
    if (is_name(submitted.batch)) return submitted;
  } catch (const InputError&) {
  }
  return std::nullopt;
}

void remove_submitted_job(const fs::path& work) {
  std::error_code error;
  fs::remove(work / kSubmittedFile, error);
}

void write_failures(const fs::path& work, int failures) {
  base::write_file(work / kRetriesFile, base::Json::object().set("failures", failures).text());
}

int read_failures(const fs::path& work) {
  std::error_code error;
  if (!fs::exists(work / kRetriesFile, error)) return 0;
  try {
    return static_cast<int>(base::read_document(work / kRetriesFile).root().integer("failures", 0, 1 << 20));
  } catch (const InputError&) {
    return 0;
  }
}

void make_batch_folder(const store::Store& store, const std::string& batch, const std::string& script, const std::vector<store::Id>& jobs) {
  const store::Temporary temporary = store.make_temporary();
  std::string ids;
  for (const store::Id& id : jobs) ids += id.text() + "\n";
  base::write_file(temporary / kJobsFile, ids);
  base::write_file(temporary / "job.sh", script);
  store.publish_batch(batch, temporary);
}

std::vector<store::Id> read_jobs(const fs::path& root, const std::string& batch) {
  std::ifstream stream(root / "slurm" / batch / kJobsFile);
  std::vector<store::Id> jobs;
  for (std::string line; std::getline(stream, line);) {
    if (const auto id = store::parse_id(line)) jobs.push_back(*id);
  }
  return jobs;
}

void write_number(const fs::path& root, const std::string& batch, const std::string& number) {
  const auto all = store::OpenFolder::open(root).find("slurm");
  const auto folder = all && is_name(batch) ? all->find(batch) : std::nullopt;
  if (folder) base::write_file(folder->path() / kNumberFile, number + "\n");
}

std::string read_number(const fs::path& root, const std::string& batch) {
  std::ifstream stream(root / "slurm" / batch / kNumberFile);
  std::string number;
  std::getline(stream, number);
  return !number.empty() && number.find_first_not_of("0123456789") == std::string::npos ? number : "";
}

void remove_batch_folder(const fs::path& root, const std::string& batch) {
  try {
    const auto all = store::OpenFolder::open(root).find("slurm");
    if (all && is_name(batch)) all->remove(batch);
  } catch (const SystemError&) {  // its owner removes it
  }
}

std::string read_output(const fs::path& root, const SubmittedJob& submitted) {
  std::ifstream stream(make_output_file(root, submitted.batch, std::max(submitted.task, 0)), std::ios::binary | std::ios::ate);
  if (!stream) return "";
  const std::streamoff size = stream.tellg();
  stream.seekg(std::max<std::streamoff>(0, size - kMaxOutputBytes));
  std::string text(static_cast<std::size_t>(std::min(size, kMaxOutputBytes)), '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(0, stream.gcount())));
  return text;
}

}  // namespace carillon::slurm
