// carillon gc: removes unreferenced entries of the store.
// Method:     A job file refers to its last submission as long as the file exists. Garbage: banks and failed or cancelled jobs without a
//             reference, inputs without a bank or job, folders of work with a published bank, temporary folders of ended processes, banks
//             set aside. Never removed: open jobs, and names that the store does not generate.
#include <fmt/core.h>
#include <sys/stat.h>

#include <algorithm>
#include <map>
#include <set>
#include <sstream>

#include "jobs/cli/commands.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/identity.hpp"
#include "jobs/store/process/process.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

namespace fs = std::filesystem;

/// An entry that can be removed.
struct Item {
  std::string kind;  // "bank", "job", "input", "work", "temporary", "damaged"
  fs::path path;
  std::string why;
  double bytes = 0.0;
  std::optional<store::Id> id = std::nullopt;
  std::string error = "";  // why its removal failed
};

/// Size of a file, or of everything in a folder.
double calc_bytes(const fs::path& path) {
  std::error_code error;
  if (fs::is_regular_file(path, error)) return static_cast<double>(fs::file_size(path, error));
  double sum = 0.0;
  for (fs::recursive_directory_iterator it(path, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (it->is_regular_file(ignored)) sum += static_cast<double>(it->file_size(ignored));
  }
  return sum;
}

/// The file of a submission; of a manifest, without the line number.
fs::path find_file(const std::string& job_file) {
  fs::path file = store::from_text(job_file);
  struct stat info {};
  if (::lstat(file.c_str(), &info) == 0) return file;
  const std::size_t mark = job_file.rfind('#');
  return mark == std::string::npos ? file : store::from_text(job_file.substr(0, mark));
}

/// True if the file certainly does not exist; other errors are no proof.
bool is_gone(const fs::path& file) {
  struct stat info {};
  return ::lstat(file.c_str(), &info) != 0 && (errno == ENOENT || errno == ENOTDIR);
}

struct References {
  std::set<store::Id> ids;                        // referred to by a job file
  std::map<store::Id, std::string> lost;          // with the removed job file that referred to it
  std::vector<registry::Submission> submissions;  // of existing files
};

References find_references(Shared& shared) {
  References found;
  for (const registry::Submission& submission : shared.registry().list_last_submissions()) {
    const store::Id id = store::require_id(submission.request.id, "registry");
    if (is_gone(find_file(submission.job_file))) {
      found.lost.emplace(id, submission.job_file);
    } else {
      found.ids.insert(id);
      found.submissions.push_back(submission);
    }
  }
  return found;
}

/// True for a folder without known submission (the log was lost) whose request names an existing job file or none.
bool is_kept_by_request(const References& references, const store::Id& id, const fs::path& folder) {
  if (references.lost.count(id) > 0) return false;
  try {
    const auto request = store::read_request(folder);
    if (!request || request->job_file.empty()) return true;
    const bool is_known = std::any_of(references.submissions.begin(), references.submissions.end(),
                                      [&](const registry::Submission& submission) { return submission.job_file == request->job_file; });
    return !is_known && !is_gone(find_file(request->job_file));
  } catch (const InputError&) {
    return false;
  }
}

std::string explain(const References& references, const store::Id& id) {
  const auto lost = references.lost.find(id);
  return lost == references.lost.end() ? "its job file has changed since"
                                       : fmt::format("its job file {} no longer exists", show(lost->second));
}

/// `name`: of a folder in tmp/, "host,boot,pid,ticks,random".
bool is_owner_gone(const std::string& name) {
  std::istringstream parts(name);
  process::Identity owner;
  std::string pid, ticks;
  if (!std::getline(parts, owner.host, ',') || !std::getline(parts, owner.boot, ',') || !std::getline(parts, pid, ',') ||
      !std::getline(parts, ticks, ','))
    return true;
  owner.pid = std::atoi(pid.c_str());
  owner.start_ticks = std::strtoull(ticks.c_str(), nullptr, 10);
  return process::find_life(owner) == process::Life::gone;
}

/// False: a record is unreadable, so the used inputs are unknown.
bool add_jobs(Shared& shared, const References& references, std::vector<Item>& items, std::set<fs::path>& used_inputs) {
  const store::Store& store = shared.store();
  bool is_known = true;
  const auto use_input = [&](const fs::path& folder) {
    try {
      const auto request = store::read_request(folder);
      for (const store::Input& input : request ? store::list_inputs(*request) : std::vector<store::Input>())
        used_inputs.insert(store::find_input_file(store, input).replace_extension());
    } catch (const InputError&) {
      is_known = false;
    }
  };
  for (const store::Id& id : store.list_banks()) {
    if (references.ids.count(id) > 0 || is_kept_by_request(references, id, store.bank_folder(id)))
      use_input(store.bank_folder(id));
    else
      items.push_back({"bank", store.bank_folder(id), explain(references, id), calc_bytes(store.bank_folder(id)), id});
  }
  for (const store::Id& id : store.list_work()) {
    const fs::path folder = store.work_folder(id);
    const auto job = shared.registry().find(id);
    const bool has_ended = job && (job->state == registry::JobState::failed || job->state == registry::JobState::cancelled);
    if (job && job->state == registry::JobState::done && store.has_bank(id))
      items.push_back({"work", folder, "its bank is published", calc_bytes(folder), id});
    else if (has_ended && references.ids.count(id) == 0 && !is_kept_by_request(references, id, folder))
      items.push_back({"job", folder, fmt::format("{}, and {}", to_text(job->state), explain(references, id)), calc_bytes(folder), id});
    else
      use_input(folder);
  }
  return is_known;
}

/// Names of inputs: <sha256>, with the extension of the file if it had one.
bool is_input_name(const std::string& shard, const std::string& name) {
  const std::string stem = name.substr(0, name.find('.')), ending = name.substr(std::min(stem.size() + 1, name.size()));
  const bool is_plain =
      ending.size() <= 8 && std::all_of(ending.begin(), ending.end(), [](unsigned char c) { return std::isalnum(c) != 0; });
  return store::parse_id(stem) && stem.substr(0, 2) == shard && is_plain && !name.ends_with('.');
}

void add_inputs(const store::Store& store, const std::set<fs::path>& used_inputs, std::vector<Item>& items) {
  const fs::path inputs = store.root() / "inputs";
  for (const std::string& shard : store::list_names(inputs)) {
    for (const std::string& name : store::list_names(inputs / shard)) {
      const fs::path path = inputs / shard / name;
      if (!is_input_name(shard, name) || used_inputs.count(fs::path(path).replace_extension()) > 0) continue;
      items.push_back({"input", path, "no bank and no job uses it", calc_bytes(path)});
    }
  }
}

/// "<id>-<12 hex digits>"
bool is_aside_name(const std::string& name) {
  return name.size() == 64 + 1 + 12 && store::parse_id(name.substr(0, 64)) && name[64] == '-' &&
         name.find_first_not_of("0123456789abcdef", 65) == std::string::npos;
}

void add_files(const store::Store& store, std::vector<Item>& items) {
  const fs::path temporary = store.root() / "tmp", damaged = store.root() / "damaged";
  for (const std::string& name : store::list_names(temporary)) {
    if (store::Store::is_temporary_name(name) && is_owner_gone(name))
      items.push_back({"temporary", temporary / name, "its process has ended", calc_bytes(temporary / name)});
  }
  for (const std::string& name : store::list_names(damaged)) {
    if (is_aside_name(name)) items.push_back({"damaged", damaged / name, "damaged, and set aside", calc_bytes(damaged / name)});
  }
}

void remove_items(Shared& shared, const References& references, std::vector<Item>& items) {
  std::vector<store::Id> forgotten;
  for (Item& item : items) {
    try {
      if (item.kind == "bank")
        shared.store().remove_bank(*item.id);
      else if (item.kind == "job" || item.kind == "work")
        shared.store().remove_work(*item.id);
      else
        store::remove_tree(item.path);
      if (item.kind == "bank" || item.kind == "job") forgotten.push_back(*item.id);
    } catch (const SystemError& error) {
      item.error = error.what();
    }
  }
  // On a full disk the registry was read-only; now there may be space.
  shared.reopen();
  if (shared.is_disk_full()) return;
  shared.registry().remove(forgotten);
  shared.registry().keep_submissions(references.submissions);
}

}  // namespace

int run_gc(Shared& shared, const GcOptions& options) {
  shared.works_when_full = true;
  shared.settle();
  std::vector<Item> items;
  std::set<fs::path> used_inputs;
  {
    const store::Lock lock = options.is_deleting ? shared.store().lock_exclusive() : shared.store().lock_shared();
    const References references = find_references(shared);
    if (add_jobs(shared, references, items, used_inputs)) add_inputs(shared.store(), used_inputs, items);
    add_files(shared.store(), items);
    if (options.is_deleting) remove_items(shared, references, items);
  }
  double bytes = 0.0;
  bool has_failed = false;
  base::Json root;
  root.set("deleted", options.is_deleting).set("items", base::Json::array());
  for (const Item& item : items) {
    has_failed = has_failed || !item.error.empty();
    if (item.error.empty()) bytes += item.bytes;
    base::Json entry;
    entry.set("kind", item.kind).set("path", to_json(item.path.string())).set("id", item.id ? base::Json(item.id->text()) : base::Json());
    entry.set("why", to_json(item.why)).set("bytes", item.bytes).set("error", item.error.empty() ? base::Json() : to_json(item.error));
    root["items"].append(entry);
    if (shared.json) continue;
    fmt::print("{:<9}  {:>9}  {}: {}\n", item.kind, format_bytes(item.bytes),
               show(item.path.lexically_relative(shared.store().root()).string()), item.why);
    if (!item.error.empty()) fmt::print(stderr, "carillon: {}\n", show_message(item.error));
  }
  root["bytes"] = bytes;
  if (shared.json)
    print_json(root);
  else
    fmt::print("{} item{}, {} {}\n", items.size(), items.size() == 1 ? "" : "s", format_bytes(bytes),
               items.empty()         ? "to remove"
               : options.is_deleting ? "removed"
                                     : "to remove with carillon gc --delete");
  return has_failed ? kExitSystem : 0;
}

}  // namespace carillon::cli
