// Method:     A store is a tree of folders whose names are hashes. What is added is made in tmp/, synced and renamed, so that it is there
//             whole or not at all; two who add the same make the same, and the second rename says so.
// Source:     rename(2), fsync(2), flock(2).
// Deviations: none.
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
#include <map>
#include <set>
#include <sstream>
#include <string_view>
#include <utility>

#include "jobs/store/process/process.hpp"
#include "jobs/store/bank_sum.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/seal.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

constexpr const char* kVersionText = "carillon store 1\n";
constexpr std::uint64_t kMaxVersionBytes = 1000;
constexpr const char* kContentName = "content";
constexpr std::size_t kMaxHostLength = 64;
constexpr std::size_t kFewFolders = 8;  // are synced one by one; of more, the whole file system once
const std::set<std::string> kFolders{"banks", "inputs", "work", "tmp"};

/// Throws unless the folder holds nothing, or what a store that is being made holds.
void check_empty(const fs::path& root) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(root, error)) {
    const std::string name = entry.path().filename().string();
    if (kFolders.count(name) > 0 || name == "lock" || name == "VERSION" || name.starts_with(".VERSION.")) continue;
    throw InputError(
        fmt::format("{}: no store of Carillon, and not empty; name a store, or a folder that is empty or not there yet", root.string()));
  }
  if (error)
    throw InputError(fmt::format("{}: this store cannot be read: {}; check owner, group and rights", root.string(), error.message()));
}

fs::path find_root(const fs::path& folder) {
  if (folder.empty()) throw InputError("the store's name is empty; name a folder with --store");
  const fs::path root = fs::absolute(folder).lexically_normal();
  return root.has_filename() ? root : root.parent_path();
}

void make_root(const fs::path& root) {
  std::error_code error;
  fs::create_directories(root, error);
  if (base::is_full_error(error.value())) throw_errno(root, "make this store", error.value());
  if (error || !fs::is_directory(root, error))
    throw InputError(fmt::format("{}: cannot make this store: {}; choose another folder with --store", root.string(),
                                 error ? error.message() : "this is no folder"));
}

void check_version(const fs::path& root) {
  const std::string text = base::read_file(root / "VERSION", "version file of the store", kMaxVersionBytes, "this is no store of Carillon");
  if (text == kVersionText) return;
  throw InputError(fmt::format("{}: holds \"{}\", and this program knows \"{}\"; use the newer Carillon, or another store",
                               (root / "VERSION").string(), text.substr(0, text.find('\n')),
                               std::string_view(kVersionText).substr(0, std::strlen(kVersionText) - 1)));
}

/// What the group may do in the store it may do in all that is made from now on.
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
      fmt::format("{}: you (user {}) may not write to this store: its folder belongs to user {} and group {}, rights {:04o}; a store for a "
                  "group is made with "
                  "\"install -d -m 2775 -g GROUP {}\" before its first use, or choose another with --store",
                  folder.string(), ::geteuid(), info.st_uid, info.st_gid, info.st_mode & 07777U, folder.string()));
}

/// A store, and there is a part of it that this process may not write to.
bool is_only_readable(const fs::path& root) {
  if (::access((root / "VERSION").c_str(), R_OK) != 0) return false;
  const auto refuses = [](const fs::path& path) { return ::access(path.c_str(), W_OK) != 0 && errno != ENOENT; };
  return refuses(root) || refuses(root / "registry.sqlite") ||
         std::any_of(kFolders.begin(), kFolders.end(), [&](const std::string& name) { return refuses(root / name); });
}

void make_content(const fs::path& root) {
  check_empty(root);
  for (const std::string& name : kFolders) make_folder(root / name);
  const int fd = ::open((root / "lock").c_str(), O_RDONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0664);
  if (fd < 0) throw_errno(root / "lock", "make this file", errno);
  ::close(fd);
  base::write_file(root / "VERSION", kVersionText);
}

/// Throws where something else than a folder, or a regular file, lies under a name of the store's own.
void check_own_names(const fs::path& root) {
  constexpr std::pair<const char*, bool> kOwn[] = {
      {"banks", false},           {"inputs", false}, {"work", false}, {"tmp", false},          {"damaged", false},
      {"slurm", false},           {"VERSION", true}, {"lock", true},  {"registry.lock", true}, {"registry.sqlite", true},
      {"submissions.jsonl", true}};
  for (const auto& [name, is_file] : kOwn) {
    struct stat info {};
    if (::lstat((root / name).c_str(), &info) != 0) continue;
    if (is_file ? S_ISREG(info.st_mode) : S_ISDIR(info.st_mode)) continue;
    throw InputError(fmt::format("{}: {}, and the store keeps a {} of its own here; find out who put it there, and remove it",
                                 (root / name).string(), S_ISLNK(info.st_mode) ? "this is a link" : "this is something else",
                                 is_file ? "file" : "folder"));
  }
}

bool is_there(const fs::path& path) {
  struct stat info {};
  return ::lstat(path.c_str(), &info) == 0 && S_ISDIR(info.st_mode);
}

std::vector<Id> list_ids(const fs::path& root, const char* folder) {
  std::vector<Id> ids;
  try {
    const OpenFolder top = OpenFolder::open(root);
    const auto opened = top.find(folder);
    for (const std::string& name : opened ? opened->list() : std::vector<std::string>()) {
      const auto info = opened->look_at(name);
      if (name.size() != 2 || !info || !S_ISDIR(info->st_mode)) continue;
      const auto shard = opened->find(name);
      for (const std::string& entry : shard ? shard->list() : std::vector<std::string>()) {
        const auto id = parse_id(entry);
        const auto kind = id && name == entry.substr(0, 2) ? shard->look_at(entry) : std::nullopt;
        if (kind && S_ISDIR(kind->st_mode)) ids.push_back(*id);
      }
    }
  } catch (const SystemError&) {  // what cannot be read, or was replaced meanwhile
  }
  return ids;
}

fs::path sharded(const fs::path& folder, const Id& id) { return folder / id.text().substr(0, 2) / id.text(); }

/// False when there is a folder of that name already. What else has the name goes: nothing but folders belongs there.
bool rename_into(const OpenFolder& from, const std::string& name, const OpenFolder& shard, const Id& id) {
  for (int round = 0; round < 2; ++round) {
    if (::renameat(from.get(), name.c_str(), shard.get(), id.text().c_str()) == 0) return true;
    if (errno == EEXIST || errno == ENOTEMPTY) return false;
    if (errno != ENOTDIR || ::unlinkat(shard.get(), id.text().c_str(), 0) != 0) break;
  }
  throw_errno(shard.name() / id.text(), "rename", errno);
}

}  // namespace

Lock::Lock(Lock&& other) noexcept : descriptor_(other.descriptor_) { other.descriptor_ = -1; }

Lock::~Lock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Store Store::open(const fs::path& folder) {
  const fs::path root = find_root(folder);
  make_root(root);
  check_own_names(root);
  follow_group(root);
  check_rights(root);
  if (::access((root / "VERSION").c_str(), F_OK) != 0) make_content(root);
  check_version(root);
  for (const std::string& name : kFolders) {
    if (!is_there(root / name)) make_folder(root / name);
    check_rights(root / name);
  }
  check_own_names(root);  // what was made meanwhile
  return Store(root);
}

Store Store::open_to_read(const fs::path& folder) {
  const fs::path root = find_root(folder);
  if (!is_only_readable(root)) return open(folder);
  check_own_names(root);
  check_version(root);
  Store store(root);
  store.may_write_ = false;
  return store;
}

fs::path Store::bank_folder(const Id& id) const { return sharded(root_ / "banks", id); }
fs::path Store::work_folder(const Id& id) const { return sharded(root_ / "work", id); }

std::optional<OpenFolder> Store::find_shard(const char* folder, const Id& id) const {
  const auto opened = OpenFolder::open(root_).find(folder);
  return opened ? opened->find(id.text().substr(0, 2)) : std::nullopt;
}

bool Store::has_bank_folder(const Id& id) const {
  try {
    const auto shard = find_shard("banks", id);
    return shard && shard->find(id.text());
  } catch (const SystemError&) {
    return false;
  }
}

bool Store::has_work(const Id& id) const {
  try {
    const auto shard = find_shard("work", id);
    return shard && shard->find(id.text());
  } catch (const SystemError&) {
    return false;
  }
}

void Store::replace_records(const Id& id, const Temporary& folder) const {
  const OpenFolder bank = open_bank(id);
  if (::fchmod(bank.get(), 0755) != 0) throw_errno(bank.name(), "write to this folder", errno);
  bool has_record = false;  // what else lies next to a bank must not make a damaged record look like one that was published
  for (const std::string& name : folder.content().list()) {
    has_record = has_record || is_record(name);
    seal_file(folder.content(), name);
    if (bank.look_at(name)) bank.remove(name);
    if (::renameat(folder.content().get(), name.c_str(), bank.get(), name.c_str()) != 0) throw_errno(bank.name() / name, "write", errno);
  }
  if (const auto sum = read_sum(bank); has_record && sum && sum->id == id.text()) write_sum(bank, *sum);
  bank.sync();
  ::fchmod(bank.get(), 0555);
}

std::string Store::set_bank_aside(const Id& id) const {
  const auto shard = find_shard("banks", id);
  const auto info = shard ? shard->look_at(id.text()) : std::nullopt;
  if (!info) return "";
  const OpenFolder aside = open_folder("damaged");
  if (S_ISDIR(info->st_mode) && (info->st_mode & S_IWUSR) == 0) {
    if (const auto folder = shard->find(id.text())) ::fchmod(folder->get(), 0755);
  }
  for (;;) {
    const std::string name = fmt::format("{}-{}", id.text(), make_random_name().substr(0, 12));
    if (::renameat(shard->get(), id.text().c_str(), aside.get(), name.c_str()) == 0) {
      shard->sync();
      aside.sync();
      return "damaged/" + name;
    }
    if (errno == ENOENT) return "";
    if (errno != EEXIST && errno != ENOTEMPTY) throw_errno(shard->name() / id.text(), "set aside", errno);
  }
}

OpenFolder Store::open_folder(const std::string& name) const { return OpenFolder::open(root_).make(name); }

OpenFolder Store::open_job(const char* folder_name, const Id& id) const {
  const auto shard = find_shard(folder_name, id);
  auto folder = shard ? shard->find(id.text()) : std::nullopt;
  if (!folder) throw_errno(sharded(root_ / folder_name, id), "open this folder", ENOENT);
  return std::move(*folder);
}

fs::path Store::find_folder(const Id& id) const {
  return has_bank(id) || (has_bank_folder(id) && !has_work(id)) ? bank_folder(id) : work_folder(id);
}
std::vector<Id> Store::list_banks() const { return list_ids(root_, "banks"); }
std::vector<Id> Store::list_work() const { return list_ids(root_, "work"); }

fs::path Store::input_folder(const Id& sha256) const { return root_ / "inputs" / sha256.text().substr(0, 2); }

Temporary Store::make_temporary() const {
  const process::Identity self = process::find_self();
  std::string host = self.host.substr(0, kMaxHostLength);
  std::replace(host.begin(), host.end(), '/', '_');
  std::replace(host.begin(), host.end(), ',', '_');
  const std::string name = fmt::format("{},{},{},{},{}", host, self.boot, self.pid, self.start_ticks, make_random_name().substr(0, 12));
  OpenFolder parent = open_folder("tmp");
  OpenFolder own = parent.make_private(name);
  OpenFolder content = own.make(kContentName);
  return {std::move(parent), name, std::move(own), std::move(content)};
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
  if (own_.get() < 0) return;
  try {
    parent_.remove(name_);
  } catch (const SystemError&) {  // gc does later
  }
}

bool Store::publish(const Id& id, const Temporary& folder) const {
  const auto end = [&](bool is_published) {
    folder.parent_.remove(folder.name_);
    return is_published;
  };
  for (int round = 0; round < 2; ++round) {
    if (has_bank(id)) return end(false);
    if (round == 0) {
      sync_tree(folder.content(), true);
      write_sum(folder.content(), calc_sum(folder.content(), id));
      folder.content().sync();
    }
    const OpenFolder banks = open_folder("banks"), shard = banks.make(id.text().substr(0, 2));
    banks.sync();
    if (!rename_into(folder.own_, kContentName, shard, id)) {
      if (has_bank(id)) return end(false);
      set_bank_aside(id);
      continue;
    }
    if (::fchmod(folder.content().get(), 0555) != 0) throw_errno(bank_folder(id), "make read-only", errno);
    folder.content().sync();
    shard.sync();
    return end(true);
  }
  return end(false);
}

std::vector<bool> Store::publish_work(const Temporary& folder, const std::vector<Prepared>& prepared) const {
  if (prepared.size() <= kFewFolders)
    sync_tree(folder.content(), false);
  else if (::syncfs(folder.content().get()) != 0)
    throw_errno(folder.content().name(), "write", errno);
  std::vector<bool> was_made;
  std::map<std::string, OpenFolder> shards;
  const OpenFolder work = open_folder("work");
  for (const Prepared& entry : prepared) {
    const std::string digits = entry.id.text().substr(0, 2);
    if (shards.count(digits) == 0) shards.emplace(digits, work.make(digits));
    was_made.push_back(rename_into(folder.content(), entry.name, shards.at(digits), entry.id));
  }
  for (const auto& [digits, shard] : shards) shard.sync();
  work.sync();
  return was_made;
}

void Store::publish_batch(const std::string& batch, const Temporary& folder) const {
  const OpenFolder all = open_folder("slurm");
  if (::renameat(folder.own_.get(), kContentName, all.get(), batch.c_str()) != 0)
    throw_errno(all.name() / batch, "make this folder", errno);
}

void Store::remove_folder(const char* folder, const Id& id) const {
  const auto shard = find_shard(folder, id);
  const auto info = shard ? shard->look_at(id.text()) : std::nullopt;
  if (!info) return;
  if (S_ISDIR(info->st_mode) && (info->st_mode & S_IWUSR) == 0) {
    if (const auto opened = shard->find(id.text())) ::fchmod(opened->get(), 0755);
  }
  std::optional<Temporary> temporary;
  try {
    temporary.emplace(make_temporary());
  } catch (const SystemError& error) {
    if (!is_disk_full(root_, error)) throw;
  }
  // A full disk may have no room for another folder: what is left in the middle of this is no whole bank and no job, and is seen as such.
  if (!temporary) return shard->remove(id.text());
  if (::renameat(shard->get(), id.text().c_str(), temporary->content().get(), "removed") != 0 && errno != ENOENT) {
    const int error = errno;
    if (const auto opened = S_ISDIR(info->st_mode) ? shard->find(id.text()) : std::nullopt) ::fchmod(opened->get(), info->st_mode & 07777U);
    throw_errno(shard->name() / id.text(), "remove", error);
  }
  shard->sync();
  temporary->content().remove("removed");
}

void Store::remove_work(const Id& id) const { remove_folder("work", id); }
void Store::remove_bank(const Id& id) const { remove_folder("banks", id); }

Lock Store::take_lock(int operation) const {
  const fs::path file = root_ / "lock";
  const int fd = ::open(file.c_str(), O_RDONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0664);
  if (fd < 0) throw_errno(file, "open", errno);
  Lock lock(fd);
  while (::flock(fd, operation) != 0) {
    if (errno != EINTR) throw_errno(file, "lock", errno);
  }
  return lock;
}

Lock Store::lock_shared() const { return take_lock(LOCK_SH); }
Lock Store::lock_exclusive() const { return take_lock(LOCK_EX); }

fs::path find_default_store() {
  const char* data = std::getenv("XDG_DATA_HOME");
  if (data != nullptr && fs::path(data).is_absolute()) return fs::path(data) / "carillon";
  const char* home = std::getenv("HOME");
  if (home != nullptr && fs::path(home).is_absolute()) return fs::path(home) / ".local/share/carillon";
  throw InputError("there is no HOME to keep a store in; name a folder with --store");
}

}  // namespace carillon::store
