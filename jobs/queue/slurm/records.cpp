#include "jobs/queue/slurm/records.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <fstream>
#include <system_error>

#include "jobs/queue/slurm/script.hpp"
#include "jobs/store/files.hpp"
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
constexpr std::streamoff kOutputTailBytes = 4096;

bool is_name(const std::string& text) { return text.size() == 32 && text.find_first_not_of("0123456789abcdef") == std::string::npos; }

/// Cores and memory, then one job per line: id, ranks, GB, predicted seconds, time limit.
std::string format_task(const TaskList& list) {
  std::string text = fmt::format("{} {}\n", list.cores, list.memory_gb);
  for (const TaskJob& job : list.jobs)
    text += fmt::format("{} {} {} {} {}\n", job.id.text(), job.placed.ranks, job.placed.memory_gb, job.placed.seconds, job.time_limit_s);
  return text;
}

}  // namespace

void write_submitted_job(const fs::path& work, const SubmittedJob& submitted) {
  base::Json root = base::Json::object();
  root.set("batch", submitted.batch).set("title", submitted.title).set("task", submitted.task);
  if (submitted.place >= 0) root.set("place", submitted.place);
  if (submitted.is_unwanted) root.set("unwanted", true);
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
    submitted.place = static_cast<int>(root.integer_if("place", -1, 1 << 30).value_or(-1));
    submitted.is_unwanted = root.boolean_or("unwanted", false);
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

std::optional<TaskList> read_task(const fs::path& root, const std::string& batch, int task) {
  if (!is_name(batch)) return std::nullopt;
  std::ifstream stream(root / "slurm" / batch / fmt::format("{}.jobs", task));
  TaskList list;
  if (!(stream >> list.cores >> list.memory_gb) || list.cores < 1) return std::nullopt;
  std::string text;
  double time_limit_s = 0.0;
  for (Placed placed; stream >> text >> placed.ranks >> placed.memory_gb >> placed.seconds >> time_limit_s;) {
    const std::optional<store::Id> id = store::parse_id(text);
    if (!id || placed.ranks < 1) return std::nullopt;
    placed.job = list.jobs.size();
    list.jobs.push_back({*id, placed, time_limit_s});
  }
  return list;
}

void write_begun(const fs::path& root, const std::string& batch, int task) {
  base::write_file(root / "slurm" / batch / fmt::format("{}.begun", task), "");
}

bool has_begun(const fs::path& root, const SubmittedJob& submitted) {
  std::error_code error;
  return fs::exists(root / "slurm" / submitted.batch / fmt::format("{}.begun", submitted.task), error);
}

void make_batch_folder(const store::Store& store, const std::string& batch, const std::string& script, const std::vector<store::Id>& jobs,
                       const std::vector<TaskList>& tasks) {
  store::Temporary temporary = store.make_temporary();
  std::string ids;
  for (const store::Id& id : jobs) ids += id.text() + "\n";
  base::write_file(temporary / kJobsFile, ids);
  base::write_file(temporary / "job.sh", script);
  for (std::size_t task = 0; task < tasks.size(); ++task)
    base::write_file(temporary / fmt::format("{}.jobs", task), format_task(tasks[task]));
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
  std::error_code error;
  if (fs::exists(root / "slurm" / batch, error)) base::write_file(root / "slurm" / batch / kNumberFile, number + "\n");
}

std::string read_number(const fs::path& root, const std::string& batch) {
  std::ifstream stream(root / "slurm" / batch / kNumberFile);
  std::string number;
  std::getline(stream, number);
  return !number.empty() && number.find_first_not_of("0123456789") == std::string::npos ? number : "";
}

void remove_batch_folder(const fs::path& root, const std::string& batch) {
  try {
    if (is_name(batch)) store::remove_tree(root / "slurm" / batch);
  } catch (const SystemError&) {  // removed later by its owner
  }
}

std::string read_output(const fs::path& root, const SubmittedJob& submitted) {
  std::ifstream stream(make_output_file(root, submitted.batch, std::max(submitted.task, 0)), std::ios::binary | std::ios::ate);
  if (!stream) return "";
  const std::streamoff size = stream.tellg();
  stream.seekg(std::max<std::streamoff>(0, size - kOutputTailBytes));
  std::string text(std::min(size, kOutputTailBytes), '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(std::max<std::streamsize>(0, stream.gcount()));
  return text;
}

}  // namespace carillon::slurm
