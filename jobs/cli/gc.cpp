// carillon gc: what no job refers to.
// Method:     A job file refers to what it was last submitted as, for as long as the file is there. Banks, failed and cancelled jobs that
//             no job file refers to are garbage; so are inputs that no bank and no job was made of, folders of work whose bank is
//             published, temporary folders of processes that are gone, and registries and banks that were set aside. Names that the store
//             does not give stay. What is queued, waits or runs never is.
// Source:     own.
// Deviations: none.
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <map>
#include <set>
#include <sstream>
#include <string_view>

#include "jobs/cli/commands.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/identity.hpp"
#include "jobs/store/open_folder.hpp"
#include "jobs/store/process/process.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

namespace fs = std::filesystem;

/// Something that could go.
struct Item {
  std::string kind;  // "bank", "job", "input", "work", "temporary", "damaged", "registry"
  fs::path path;
  std::string why;
  double bytes = 0.0;
  std::optional<store::Id> id = std::nullopt;
  std::string error = "";  // why it could not be removed
};

/// Of what has this name in a folder, links not followed.
double calc_bytes(const store::OpenFolder& folder, const std::string& name) {
  const auto info = folder.look_at(name);
  if (!info) return 0.0;
  if (!S_ISDIR(info->st_mode)) return S_ISREG(info->st_mode) ? static_cast<double>(info->st_size) : 0.0;
  double sum = 0.0;
  try {
    const auto inner = folder.find(name);
    for (const std::string& entry : inner ? inner->list() : std::vector<std::string>()) sum += calc_bytes(*inner, entry);
  } catch (const SystemError&) {  // what may not be read counts for nothing
  }
  return sum;
}

double calc_bytes(const store::Store& store, const char* folder, const store::Id& id) {
  try {
    return calc_bytes(store.open_folder(folder).make(id.text().substr(0, 2)), id.text());
  } catch (const SystemError&) {
    return 0.0;
  }
}

/// The file of a submission: a manifest without the number of its line.
fs::path find_file(const std::string& job_file) {
  fs::path file = store::from_text(job_file);
  struct stat info {};
  if (::lstat(file.c_str(), &info) == 0) return file;
  const std::size_t mark = job_file.rfind('#');
  return mark == std::string::npos ? file : store::from_text(job_file.substr(0, mark));
}

/// Gone for sure: a disk that does not answer or rights that are lacking are no proof.
bool is_gone(const fs::path& file) {
  struct stat info {};
  return ::lstat(file.c_str(), &info) != 0 && (errno == ENOENT || errno == ENOTDIR);
}

struct References {
  std::set<store::Id> ids;                        // that a job file refers to
  std::map<store::Id, std::string> lost;          // a job file that is gone referred to it
  std::vector<registry::Submission> submissions;  // of files that are there
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

/// A folder whose own request names a job file that is there, or none, while no submission is known of it: the log was lost, and the job
/// stays.
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
  return lost == references.lost.end() ? "its job file asks for something else now"
                                       : fmt::format("its job file {} is gone", show(lost->second));
}

/// The process that a folder of tmp/ belongs to: "host,boot,pid,ticks,random".
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

/// False: a record could not be read, so it is not known which inputs are used.
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
      items.push_back({"bank", store.bank_folder(id), explain(references, id), calc_bytes(store, "banks", id), id});
  }
  for (const store::Id& id : store.list_work()) {
    const fs::path folder = store.work_folder(id);
    const auto job = shared.registry().find(id);
    const bool has_ended = job && (job->state == registry::JobState::failed || job->state == registry::JobState::cancelled);
    if (job && job->state == registry::JobState::done && store.has_bank(id))
      items.push_back({"work", folder, "its bank is published", calc_bytes(store, "work", id), id});
    else if (has_ended && references.ids.count(id) == 0 && !is_kept_by_request(references, id, folder))
      items.push_back(
          {"job", folder, fmt::format("{}, and {}", to_text(job->state), explain(references, id)), calc_bytes(store, "work", id), id});
    else
      use_input(folder);
  }
  return is_known;
}

/// The names that the store gives: <sha256>, with an ending where the input had one.
bool is_input_name(const std::string& shard, const std::string& name) {
  const std::string stem = name.substr(0, name.find('.')), ending = name.substr(std::min(stem.size() + 1, name.size()));
  const bool is_plain =
      ending.size() <= 8 && std::all_of(ending.begin(), ending.end(), [](unsigned char c) { return std::isalnum(c) != 0; });
  return store::parse_id(stem) && stem.substr(0, 2) == shard && is_plain && !name.ends_with('.');
}

void add_inputs(const store::Store& store, const std::set<fs::path>& used_inputs, std::vector<Item>& items) {
  const store::OpenFolder inputs = store.open_folder("inputs");
  for (const std::string& digits : inputs.list()) {
    const auto kind = inputs.look_at(digits);
    if (digits.size() != 2 || !kind || !S_ISDIR(kind->st_mode)) continue;
    const auto shard = inputs.find(digits);
    for (const std::string& name : shard ? shard->list() : std::vector<std::string>()) {
      const fs::path path = store.root() / "inputs" / digits / name;
      const auto info = shard->look_at(name);
      if (!info || !S_ISREG(info->st_mode) || !is_input_name(digits, name) || used_inputs.count(fs::path(path).replace_extension()) > 0)
        continue;
      items.push_back({"input", path, "no bank and no job is made of it", calc_bytes(*shard, name)});
    }
  }
}

/// "registry.damaged-3.sqlite", and the same with -journal, -wal and -shm.
bool is_damaged_registry(std::string_view name) {
  for (const std::string_view ending : {"-journal", "-wal", "-shm"}) {
    if (name.ends_with(ending)) name.remove_suffix(ending.size());
  }
  constexpr std::string_view kBegin = "registry.damaged-", kEnd = ".sqlite";
  if (!name.starts_with(kBegin) || !name.ends_with(kEnd) || name.size() <= kBegin.size() + kEnd.size()) return false;
  const std::string_view number = name.substr(kBegin.size(), name.size() - kBegin.size() - kEnd.size());
  return number.find_first_not_of("0123456789") == std::string_view::npos;
}

/// "<id>-<12 hex digits>"
bool is_aside_name(const std::string& name) {
  return name.size() == 64 + 1 + 12 && store::parse_id(name.substr(0, 64)) && name[64] == '-' &&
         name.find_first_not_of("0123456789abcdef", 65) == std::string::npos;
}

void add_files(const store::Store& store, std::vector<Item>& items) {
  const store::OpenFolder temporary = store.open_folder("tmp");
  for (const std::string& name : temporary.list()) {
    const auto info = temporary.look_at(name);
    if (!info || !S_ISDIR(info->st_mode) || !store::Store::is_temporary_name(name) || !is_owner_gone(name)) continue;
    if (::geteuid() != 0 && info->st_uid != ::geteuid()) continue;  // its owner alone may enter it
    items.push_back({"temporary", store.root() / "tmp" / name, "the process that made it is gone", calc_bytes(temporary, name)});
  }
  if (const auto aside = store::OpenFolder::open(store.root()).find("damaged")) {
    for (const std::string& name : aside->list()) {
      if (is_aside_name(name))
        items.push_back({"damaged", store.root() / "damaged" / name, "damaged, and set aside", calc_bytes(*aside, name)});
    }
  }
  const store::OpenFolder folder = store::OpenFolder::open(store.registry_folder());
  for (const std::string& name : folder.list()) {
    const auto info = folder.look_at(name);
    if (info && S_ISREG(info->st_mode) && is_damaged_registry(name))
      items.push_back({"registry", store.registry_folder() / name, "damaged, and made again", calc_bytes(folder, name)});
  }
}

/// Removes a file or a folder of the store that is no bank and no work: its last folder is opened step by step from the root.
void remove_path(const store::Store& store, const Item& item) {
  if (item.kind == "registry") return store::OpenFolder::open(item.path.parent_path()).remove(item.path.filename().string());
  store::OpenFolder folder = store::OpenFolder::open(store.root());
  for (const fs::path& part : item.path.parent_path().lexically_relative(store.root())) {
    auto next = folder.find(part.string());
    if (!next) return;
    folder = std::move(*next);
  }
  folder.remove(item.path.filename().string());
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
        remove_path(shared.store(), item);
      if (item.kind == "bank" || item.kind == "job") forgotten.push_back(*item.id);
    } catch (const SystemError& error) {
      item.error = error.what();
    }
  }
  // On a full disk the registry could only be read; now there may be room.
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
  root["deleted"] = options.is_deleting;
  root["items"] = base::Json::array();
  for (const Item& item : items) {
    has_failed = has_failed || !item.error.empty();
    if (item.error.empty()) bytes += item.bytes;
    base::Json entry;
    entry["kind"] = item.kind;
    entry["path"] = to_json(item.path.string());
    entry["id"] = item.id ? base::Json(item.id->text()) : base::Json();
    entry["why"] = to_json(item.why);
    entry["bytes"] = item.bytes;
    entry["error"] = item.error.empty() ? base::Json() : to_json(item.error);
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
    fmt::print("{} thing{}, {} {}\n", items.size(), items.size() == 1 ? "" : "s", format_bytes(bytes),
               items.empty()         ? "to remove"
               : options.is_deleting ? "removed"
                                     : "could be removed; carillon gc --delete does");
  return has_failed ? kExitSystem : 0;
}

}  // namespace carillon::cli
