// Method:     A store is a tree of folders named by hashes. New folders are filled in tmp/, synced and renamed: atomic publication. Two
//             processes that publish the same id produce the same content; the second rename fails and reports it.
// Source:     rename(2), fsync(2), flock(2).
#include "jobs/store/store.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <set>
#include <sstream>
#include <string_view>

#include "jobs/store/bank_sum.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/process/process.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

constexpr const char* kVersionText = "carillon store 1\n";
constexpr std::uint64_t kMaxVersionBytes = 1000;
constexpr std::size_t kMaxHostLength = 64;
constexpr std::size_t kFewFolders = 8;  // synced one by one; for more, syncfs once
const std::set<std::string> kFolders{"banks", "inputs", "work", "tmp"};

/// Throws unless the folder is empty or holds a store in creation.
void check_empty(const fs::path& root) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(root, error)) {
    const std::string name = entry.path().filename().string();
    if (kFolders.count(name) > 0 || name == "lock" || name == "VERSION" || name.starts_with(".VERSION.")) continue;
    throw InputError(fmt::format("{}: not a Carillon store, and not empty; name a store, or an empty or new folder", root.string()));
  }
  if (error) throw InputError(fmt::format("{}: cannot read this store: {}; check owner, group and rights", root.string(), error.message()));
}

fs::path find_root(const fs::path& folder) {
  if (folder.empty()) throw InputError("the store's name is empty; name a folder with --store");
  const fs::path root = fs::absolute(folder).lexically_normal();
  return root.has_filename() ? root : root.parent_path();
}

void make_root(const fs::path& root) {
  std::error_code error;
  fs::create_directories(root, error);
  if (base::is_full_error(error.value())) throw_errno(root, "create store", error.value());
  if (error || !fs::is_directory(root, error))
    throw InputError(fmt::format("{}: cannot create store: {}; choose another folder with --store", root.string(),
                                 error ? error.message() : "not a directory"));
}

void check_version(const fs::path& root) {
  const std::string text = base::read_file(root / "VERSION", "version file of the store", kMaxVersionBytes, "not a Carillon store");
  if (text == kVersionText) return;
  throw InputError(fmt::format("{}: version \"{}\", but this program supports \"{}\"; use the newer Carillon, or another store",
                               (root / "VERSION").string(), text.substr(0, text.find('\n')),
                               std::string_view(kVersionText).substr(0, std::strlen(kVersionText) - 1)));
}

/// Group rights of the store apply to everything this process creates.
void follow_group(const fs::path& root) {
  struct stat info {};
  if (::stat(root.c_str(), &info) != 0 || (info.st_mode & S_IWGRP) == 0) return;
  const mode_t mask = ::umask(0);
  ::umask(mask & ~static_cast<mode_t>(S_IRWXG));
  if ((info.st_mode & S_ISGID) == 0 && info.st_uid == ::geteuid()) ::chmod(root.c_str(), (info.st_mode & 07777U) | S_ISGID);
}

void check_rights(const fs::path& folder) {
  if (::access(folder.c_str(), R_OK | W_OK | X_OK) == 0) return;
  const int error = errno;
  struct stat info {};
  ::stat(folder.c_str(), &info);
  if (base::is_full_error(error) || error == EROFS) throw_errno(folder, "write to this store", error);
  throw InputError(
      fmt::format("{}: you (user {}) may not write to this store: its folder belongs to user {} and group {}, rights {:04o}; to create a "
                  "store for a group, run \"install -d -m 2775 -g GROUP {}\" before its first use, or choose another with --store",
                  folder.string(), ::geteuid(), info.st_uid, info.st_gid, info.st_mode & 07777U, folder.string()));
}

/// True for a store that this process may read, but not write completely.
bool is_only_readable(const fs::path& root) {
  if (::access((root / "VERSION").c_str(), R_OK) != 0) return false;
  const auto refuses = [](const fs::path& path) { return ::access(path.c_str(), W_OK) != 0 && errno != ENOENT; };
  return refuses(root) || refuses(root / "registry.sqlite") ||
         std::any_of(kFolders.begin(), kFolders.end(), [&](const std::string& name) { return refuses(root / name); });
}

bool is_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

void make_content(const fs::path& root) {
  check_empty(root);
  for (const std::string& name : kFolders) make_folder(root / name);
  base::write_file(root / "VERSION", kVersionText);
}

std::vector<Id> list_ids(const fs::path& folder) {
  std::vector<Id> ids;
  for (const std::string& shard : list_names(folder)) {
    if (shard.size() != 2) continue;
    for (const std::string& name : list_names(folder / shard)) {
      const auto id = parse_id(name);
      if (id && shard == name.substr(0, 2) && is_folder(folder / shard / name)) ids.push_back(*id);
    }
  }
  return ids;
}

fs::path sharded(const fs::path& folder, const Id& id) { return folder / id.text().substr(0, 2) / id.text(); }

/// Renames a folder to `target`, whose parent it creates. False if `target` exists.
bool rename_to(const fs::path& from, const fs::path& target) {
  make_folder(target.parent_path());
  if (::rename(from.c_str(), target.c_str()) == 0) return true;
  if (errno == EEXIST || errno == ENOTEMPTY) return false;
  throw_errno(target, "rename", errno);
}

/// A read-only folder cannot be moved.
void make_writable(const fs::path& folder) { ::chmod(folder.c_str(), 0755); }

}  // namespace

Lock::Lock(const fs::path& file, int operation) : descriptor_(::open(file.c_str(), O_RDONLY | O_CREAT | O_CLOEXEC | O_NONBLOCK, 0664)) {
  if (descriptor_.get() < 0) throw_errno(file, "open", errno);
  while (::flock(descriptor_.get(), operation) != 0) {
    if (errno != EINTR) throw_errno(file, "lock", errno);
  }
}

Store Store::open(const fs::path& folder) {
  const fs::path root = find_root(folder);
  make_root(root);
  follow_group(root);
  check_rights(root);
  if (::access((root / "VERSION").c_str(), F_OK) != 0) make_content(root);
  check_version(root);
  for (const std::string& name : kFolders) {
    make_folder(root / name);
    check_rights(root / name);
  }
  return Store(root);
}

Store Store::open_to_read(const fs::path& folder) {
  const fs::path root = find_root(folder);
  if (!is_only_readable(root)) return open(folder);
  check_version(root);
  Store store(root);
  store.may_write_ = false;
  return store;
}

fs::path Store::bank_folder(const Id& id) const { return sharded(root_ / "banks", id); }
fs::path Store::work_folder(const Id& id) const { return sharded(root_ / "work", id); }

bool Store::has_bank_folder(const Id& id) const { return is_folder(bank_folder(id)); }
bool Store::has_work(const Id& id) const { return is_folder(work_folder(id)); }

void Store::replace_records(const Id& id, const Temporary& folder) const {
  const fs::path bank = bank_folder(id);
  if (::chmod(bank.c_str(), 0755) != 0) throw_errno(bank, "write to this folder", errno);
  bool has_record = false;  // other files must not refresh the sum of a damaged record
  for (const std::string& name : list_names(folder.path())) {
    has_record = has_record || is_record(name);
    const fs::path from = folder / name, to = bank / name;
    fs::is_directory(from) ? sync_tree(from, true) : seal_file(from);
    if (fs::is_directory(to)) remove_tree(to);
    if (::rename(from.c_str(), to.c_str()) != 0) throw_errno(to, "write", errno);
  }
  if (const auto sum = read_sum(bank); has_record && sum && sum->id == id.text()) write_sum(bank, *sum);
  sync_folder(bank);
  ::chmod(bank.c_str(), 0555);
}

std::string Store::set_bank_aside(const Id& id) const {
  const fs::path folder = bank_folder(id), aside = root_ / "damaged";
  if (!is_folder(folder)) return "";
  make_folder(aside);
  make_writable(folder);
  const std::string name = fmt::format("{}-{}", id.text(), make_random_name().substr(0, 12));
  if (::rename(folder.c_str(), (aside / name).c_str()) != 0) {
    if (errno == ENOENT) return "";
    throw_errno(folder, "set aside", errno);
  }
  sync_folder(folder.parent_path());
  sync_folder(aside);
  return "damaged/" + name;
}

fs::path Store::find_folder(const Id& id) const {
  return has_bank(id) || (has_bank_folder(id) && !has_work(id)) ? bank_folder(id) : work_folder(id);
}
std::vector<Id> Store::list_banks() const { return list_ids(root_ / "banks"); }
std::vector<Id> Store::list_work() const { return list_ids(root_ / "work"); }

fs::path Store::input_folder(const Id& sha256) const { return root_ / "inputs" / sha256.text().substr(0, 2); }

Temporary Store::make_temporary() const {
  const process::Identity self = process::find_self();
  std::string host = self.host.substr(0, kMaxHostLength);
  std::replace(host.begin(), host.end(), '/', '_');
  std::replace(host.begin(), host.end(), ',', '_');
  const std::string name = fmt::format("{},{},{},{},{}", host, self.boot, self.pid, self.start_ticks, make_random_name().substr(0, 12));
  const fs::path path = root_ / "tmp" / name;
  make_folder(path);
  return Temporary(path);
}

bool Store::is_temporary_name(const std::string& name) {
  std::vector<std::string> parts;
  std::istringstream stream(name);
  for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
  const auto is_of = [](const std::string& text, const char* letters) {
    return !text.empty() && text.find_first_not_of(letters) == std::string::npos;
  };
  return parts.size() == 5 && is_of(parts[1], "0123456789abcdef-:") && is_of(parts[2], "0123456789") && is_of(parts[3], "0123456789") &&
         is_of(parts[4], "0123456789abcdef") && parts[4].size() == 12 && !name.ends_with(',');
}

Temporary::~Temporary() {
  if (path_.empty()) return;
  try {
    remove_tree(path_);
  } catch (const SystemError&) {  // left to gc
  }
}

bool Store::publish(const Id& id, Temporary& folder) const {
  if (has_bank(id)) return false;
  sync_tree(folder.path(), true);
  write_sum(folder.path(), calc_sum(folder.path(), id));
  sync_folder(folder.path());
  const fs::path target = bank_folder(id);
  while (!rename_to(folder.path(), target)) {
    if (has_bank(id)) return false;
    set_bank_aside(id);
  }
  folder.path_.clear();
  if (::chmod(target.c_str(), 0555) != 0) throw_errno(target, "make read-only", errno);
  for (const fs::path& changed : {target, target.parent_path(), root_ / "banks"}) sync_folder(changed);
  return true;
}

std::vector<bool> Store::publish_work(const Temporary& folder, const std::vector<Prepared>& prepared) const {
  if (prepared.size() <= kFewFolders) {
    sync_tree(folder.path(), false);
  } else {
    const base::Descriptor opened(::open(folder.path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (::syncfs(opened.get()) != 0) throw_errno(folder.path(), "write", errno);
  }
  std::vector<bool> was_made;
  std::set<fs::path> changed{root_ / "work"};
  for (const Prepared& entry : prepared) {
    const fs::path target = work_folder(entry.id);
    was_made.push_back(rename_to(folder / entry.name, target));
    changed.insert(target.parent_path());
  }
  for (const fs::path& shard : changed) sync_folder(shard);
  return was_made;
}

void Store::publish_batch(const std::string& batch, Temporary& folder) const {
  const fs::path target = root_ / "slurm" / batch;
  if (!rename_to(folder.path(), target)) throw_errno(target, "create this folder", EEXIST);
  folder.path_.clear();
}

void Store::remove_folder(const fs::path& folder) const {
  if (!is_folder(folder)) return;
  struct stat info {};
  ::stat(folder.c_str(), &info);
  make_writable(folder);
  std::optional<Temporary> temporary;
  try {
    temporary.emplace(make_temporary());
  } catch (const SystemError& error) {
    if (!is_disk_full(root_, error)) throw;
  }
  // On a full disk without room for a folder: an interrupted removal leaves neither a complete bank nor a complete job.
  if (!temporary) return remove_tree(folder);
  if (::rename(folder.c_str(), (*temporary / "removed").c_str()) != 0 && errno != ENOENT) {
    const int error = errno;
    ::chmod(folder.c_str(), info.st_mode & 07777U);
    throw_errno(folder, "remove", error);
  }
  sync_folder(folder.parent_path());
  remove_tree(*temporary / "removed");
}

void Store::remove_work(const Id& id) const { remove_folder(work_folder(id)); }
void Store::remove_bank(const Id& id) const { remove_folder(bank_folder(id)); }

Lock Store::lock_shared() const { return {root_ / "lock", LOCK_SH}; }
Lock Store::lock_exclusive() const { return {root_ / "lock", LOCK_EX}; }

fs::path find_default_store() {
  const char* data = std::getenv("XDG_DATA_HOME");
  if (data != nullptr && fs::path(data).is_absolute()) return fs::path(data) / "carillon";
  const char* home = std::getenv("HOME");
  if (home != nullptr && fs::path(home).is_absolute()) return fs::path(home) / ".local/share/carillon";
  throw InputError("HOME is not set; name a store with --store");
}

}  // namespace carillon::store
