#include "jobs/cli/shared.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>

#include "jobs/cli/gather.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/identity.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMinPrefix = 4, kMaxNamed = 5, kMaxOptions = 100;

bool is_there(const fs::path& file) {
  struct stat info {};
  return ::stat(file.c_str(), &info) == 0;
}

fs::path find_profile_file() {
  const char* config = std::getenv("XDG_CONFIG_HOME");
  if (config != nullptr && fs::path(config).is_absolute()) return fs::path(config) / "carillon/profile.json";
  const char* home = std::getenv("HOME");
  return home != nullptr && fs::path(home).is_absolute() ? fs::path(home) / ".config/carillon/profile.json" : fs::path();
}

Profile read_profile(const std::string& option) {
  Profile profile;
  profile.file = option.empty() ? find_profile_file() : fs::path(option);
  if (option.empty() && (profile.file.empty() || !is_there(profile.file))) return {};
  base::Object root = base::read_document(profile.file).root();
  if (root.has("store")) profile.store = root.path("store");
  profile.engine = *store::find_engine(root.choice_or("on", {"local", "slurm"}, "local"));
  for (const base::Entry& entry : root.entries("mpirun_options", kMaxOptions)) {
    if (entry.object) throw InputError(entry.place + ": \"mpirun_options\" is a list of arguments of mpirun");
    profile.mpirun_options.push_back(entry.text);
  }
  profile.slurm = queue::read_slurm_settings(root.object_if("slurm"));
  profile.slurm.mpirun_options = profile.mpirun_options;
  root.finish();
  return profile;
}

bool is_hex(const std::string& word) {
  return std::all_of(word.begin(), word.end(), [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); });
}

/// The job of the last submission with this Source::job_file.
std::optional<registry::Job> find_submitted(Shared& shared, const std::string& job_file) {
  const auto submission = shared.registry().find_last_submission(job_file);
  return submission ? shared.registry().find(store::require_id(submission->request.id, "registry")) : std::nullopt;
}

/// The job of a file: of its last submission, else of its content.
std::optional<registry::Job> find_by_file(Shared& shared, const std::string& word) {
  std::optional<registry::Job> job = find_submitted(shared, store::to_text(fs::absolute(word).lexically_normal()));
  if (!job && is_of_jobs(word)) job = shared.registry().find(store::require_id(gather_one(word, read_solver_version()).request.id, word));
  return job;
}

[[noreturn]] void refuse_many(const std::string& word, const std::vector<registry::Job>& jobs) {
  std::vector<std::string> names;
  for (const registry::Job& job : jobs)
    if (names.size() < kMaxNamed) names.push_back(job.id.short_text());
  throw InputError(fmt::format("{}: matches several jobs ({}{}); give one of these ids, or more digits", show(word), fmt::join(names, ", "),
                               jobs.size() >= kMaxNamed ? " ..." : ""));
}

/// By the name in carillon status.
std::optional<registry::Job> find_by_name(Shared& shared, const std::string& word) {
  std::vector<registry::Job> jobs = shared.registry().list();
  std::erase_if(jobs, [&](const registry::Job& job) { return job.name != word; });
  if (jobs.size() > 1) refuse_many(word, jobs);
  return jobs.empty() ? std::nullopt : std::optional(jobs.front());
}

}  // namespace

const Profile& Shared::profile() {
  if (!profile_) profile_ = read_profile(profile_option);
  return *profile_;
}

const store::Store& Shared::store() {
  if (!store_) {
    const fs::path folder = !store_option.empty()      ? fs::path(store_option)
                            : !profile().store.empty() ? profile().store
                                                       : store::find_default_store();
    store_ = only_reads ? store::Store::open_to_read(folder) : store::Store::open(folder);
  }
  return *store_;
}

registry::Registry& Shared::registry() {
  const auto say = [](const std::string& line) { fmt::print(stderr, "carillon: {}\n", show_message(line)); };
  if (!registry_ && !is_disk_full_ && store().may_write() && (only_reads || works_when_full)) {
    try {
      registry_.emplace(registry::Registry::open(store(), say));
    } catch (const SystemError& error) {
      if (!fall_back(error)) throw;
    }
  }
  if (!registry_)
    registry_.emplace(store().may_write() && !is_disk_full_ ? registry::Registry::open(store(), say)
                                                            : registry::Registry::open_to_read(store()));
  return *registry_;
}

bool Shared::fall_back(const SystemError& error) {
  if (!only_reads && !works_when_full) return false;
  if (!store::is_disk_full(store().root(), error) && !store::is_disk_full(store().registry_folder())) return false;
  is_disk_full_ = true;
  registry_.reset();
  if (!is_full_shown_)
    fmt::print(stderr, "carillon: the disk or quota is full ({}); states are read from the files of the store\n",
               show_message(error.what()));
  is_full_shown_ = true;
  return true;
}

void Shared::reopen() {
  if (!is_disk_full_) return;
  is_disk_full_ = false;
  registry_.reset();
  registry();
}

registry::Job find_job(Shared& shared, const std::string& word) {
  if (word.empty()) throw InputError("an id is empty; carillon status lists them");
  if (is_hex(word) && word.size() >= kMinPrefix) {
    const auto jobs = shared.registry().find_by_prefix(word, kMaxNamed);
    if (jobs.size() == 1) return jobs.front();
    if (jobs.size() > 1) refuse_many(word, jobs);
  }
  const bool is_file = is_of_jobs(word);
  if (is_file && is_of_many(word)) throw InputError(fmt::format("{}: matches several jobs; name one of them", word));
  if (auto job = find_by_file(shared, word)) return *job;
  // An existing file takes precedence over a job of the same name elsewhere.
  if (auto job = is_file ? std::nullopt : find_by_name(shared, word)) return *job;
  if (is_file || word.find('/') != std::string::npos || word.ends_with(".json"))
    throw InputError(fmt::format("{}: not a job of this store; carillon submit adds it", word));
  throw InputError(fmt::format("{}: not an id (at least {} digits), a job file or a name of carillon status", show(word), kMinPrefix));
}

std::vector<registry::Job> find_jobs(Shared& shared, const std::vector<std::string>& words) {
  std::vector<registry::Job> jobs;
  const auto add = [&](registry::Job job) {
    if (std::none_of(jobs.begin(), jobs.end(), [&](const registry::Job& other) { return other.id == job.id; }))
      jobs.push_back(std::move(job));
  };
  for (const std::string& word : words) {
    const bool is_id = is_hex(word) && word.size() >= kMinPrefix && !shared.registry().find_by_prefix(word, 1).empty();
    if (is_id || !is_of_many(word)) {
      add(find_job(shared, word));
      continue;
    }
    const std::vector<std::string> files = list_job_files(word);
    std::size_t known = 0;
    for (const std::string& file : files) {
      std::optional<registry::Job> job = find_submitted(shared, file);
      known += job ? 1 : 0;
      if (job) add(std::move(*job));
    }
    if (known == 0)
      throw InputError(fmt::format("{}: none of its {} jobs is in this store; carillon submit adds them", word, files.size()));
    if (known < files.size())
      fmt::print(stderr, "carillon: {} of the {} jobs of {} are not in this store\n", files.size() - known, files.size(), show(word));
  }
  return jobs;
}

bool is_submitted_again(const registry::Job& job, bool has_work) {
  const bool is_lost = job.state == registry::JobState::failed && (!has_work || job.attempts == 0);  // a retry has nothing to resume
  return job.state == registry::JobState::cancelled || is_lost;
}

std::string find_reason(Shared& shared, const registry::Job& job) {
  std::string reason = store::name_job(job.reason, job.id, "the job");
  const std::string inputs = (shared.store().root() / "inputs").string();
  if (reason.find(inputs) == std::string::npos) return reason;
  try {
    const auto request = store::read_request(shared.store().find_folder(job.id));
    for (const store::Input& input : request ? store::list_inputs(*request) : std::vector<store::Input>()) {
      const std::string copy = store::find_input_file(shared.store(), input).string();
      for (std::size_t at = reason.find(copy); at != std::string::npos; at = reason.find(copy, at + input.file.size()))
        reason.replace(at, copy.size(), input.file);
    }
  } catch (const InputError&) {  // damaged record: keep the path of the copy
  }
  return reason;
}

std::vector<std::string> find_warnings(Shared& shared, const registry::Job& job, const std::string& name) {
  if (job.state != registry::JobState::done) return {};
  return store::read_warnings(shared.store(), job.id, name);
}

base::Json to_json(const std::vector<std::string>& texts) {
  base::Json list = base::Json::array();
  for (const std::string& text : texts) list.append(to_json(text));
  return list;
}

std::map<std::string, fs::path> list_results(const store::Store& store, const store::Id& id) {
  const fs::path folder = store.bank_folder(id);
  std::error_code error;
  if (!fs::exists(folder / store::kRecordFile, error)) return {{"bank", folder / store::kBankFile}};
  std::map<std::string, fs::path> results;
  for (const store::Output& output : store::kOutputs)
    if (fs::exists(folder / output.file, error)) results[output.key] = folder / output.file;
  return results;
}

base::Json describe(Shared& shared, const registry::Job& job) {
  base::Json root;
  root.set("id", job.id.text()).set("state", to_text(job.state)).set("name", to_json(job.name)).set("engine", to_text(job.engine));
  root.set("reason", to_json(find_reason(shared, job))).set("attempts", job.attempts).set("failures", job.failures);
  root["ranks"] = job.given.ranks > 0 ? job.given.ranks : job.resources.ranks;  // as chosen by the queue
  root.set("memory_gb", job.given.ranks > 0 ? job.given.memory_gb : job.resources.memory_gb);
  root.set("time_limit_s", job.resources.time_limit_s).set("slurm_job", job.slurm_job.empty() ? base::Json() : to_json(job.slurm_job));
  root.set("submitted", to_json_time(job.submitted_unix_s)).set("started", to_json_time(job.started_unix_s));
  root.set("ended", to_json_time(job.ended_unix_s));
  const bool is_done = job.state == registry::JobState::done;
  const auto progress = is_done ? std::nullopt : store::read_progress(shared.store().work_folder(job.id));
  root.set("phase", is_done ? base::Json("done") : progress ? to_json(progress->phase) : base::Json());
  root.set("percent", is_done ? 100.0 : progress ? progress->percent : 0.0);
  root.set("modes_done", progress && progress->modes_done >= 0 ? base::Json(progress->modes_done) : base::Json());
  root.set("modes_wanted", progress && progress->modes_wanted >= 0 ? base::Json(progress->modes_wanted) : base::Json());
  root.set("seconds_left", progress && progress->seconds_left >= 0 && job.state == registry::JobState::running
                               ? base::Json(progress->seconds_left)
                               : base::Json());
  const auto results = is_done ? list_results(shared.store(), job.id) : std::map<std::string, fs::path>();
  root.set("bank", results.count("bank") > 0 ? to_json(results.at("bank").string()) : base::Json()).set("results", base::Json::object());
  for (const auto& [key, file] : results) root["results"][key] = to_json(file.string());
  root["warnings"] = to_json(find_warnings(shared, job));
  return root;
}

}  // namespace carillon::cli
