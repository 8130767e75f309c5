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
#include <set>

#include "jobs/process/process.hpp"
#include "jobs/store/files.hpp"
#include "runtime/config/error.hpp"
#include "runtime/config/file.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

constexpr const char* kVersionText = "carillon store 1\n";
constexpr std::uint64_t kMostVersionBytes = 1000;
constexpr off_t kMostCopiedBytes = 16 << 20;
constexpr std::size_t kMostHostLength = 64;
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
  if (error == std::errc::no_space_on_device) throw_errno(root, "make this store", ENOSPC);
  if (error || !fs::is_directory(root, error))
    throw InputError(fmt::format("{}: cannot make this store: {}; choose another folder with --store", root.string(),
                                 error ? error.message() : "this is no folder"));
}

void check_version(const fs::path& root) {
  const std::string text =
      config::read_file(root / "VERSION", "version file of the store", kMostVersionBytes, "this is no store of Carillon");
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
  if (error == ENOSPC || error == EROFS) throw_errno(folder, "write to this store", error);
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
  const int fd = ::open((root / "lock").c_str(), O_RDONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0664);
  if (fd < 0) throw_errno(root / "lock", "make this file", errno);
  ::close(fd);
  config::write_file(root / "VERSION", kVersionText);
}

bool is_there(const fs::path& path) {
  struct stat info {};
  return ::lstat(path.c_str(), &info) == 0 && S_ISDIR(info.st_mode);
}

std::vector<Id> list_ids(const fs::path& folder) {
  std::vector<Id> ids;
  std::error_code error;
  for (fs::directory_iterator shard(folder, error), end; !error && shard != end; shard.increment(error)) {
    std::error_code none;
    for (fs::directory_iterator it(shard->path(), none); !none && it != end; it.increment(none)) {
      const auto id = parse_id(it->path().filename().string());
      if (id && shard->path().filename().string() == id->text().substr(0, 2)) ids.push_back(*id);
    }
  }
  std::sort(ids.begin(), ids.end());
  return ids;
}

fs::path sharded(const fs::path& folder, const Id& id) { return folder / id.text().substr(0, 2) / id.text(); }

/// Makes a file read-only; one that another user of the store owns, and a small one that has another name elsewhere, which has to stay
/// writable, is replaced by a copy.
void seal_file(const fs::path& file) {
  struct stat info {};
  const bool is_shared = ::lstat(file.c_str(), &info) == 0 && info.st_nlink > 1 && info.st_size < kMostCopiedBytes;
  if (!is_shared && ::chmod(file.c_str(), 0444) == 0) return;
  if (!is_shared && errno != EPERM) throw_errno(file, "make read-only", errno);
  const fs::path copy = fs::path(file) += ".copy";
  std::error_code error;
  fs::copy_file(file, copy, fs::copy_options::overwrite_existing, error);
  if (!error) fs::rename(copy, file, error);
  if (error) throw_errno(file, "copy", error.value());
  if (::chmod(file.c_str(), 0444) != 0) throw_errno(file, "make read-only", errno);
}

/// Syncs the folder and all in it; with `seal`, makes files and inner folders read-only. The folder itself stays writable: only then may
/// it be renamed.
void sync_tree(const fs::path& folder, bool seal) {
  std::vector<fs::path> folders{folder};
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_symlink()) throw SystemError(fmt::format("{}: a link among the results; remove it", entry.path().string()));
    if (entry.is_directory()) {
      folders.push_back(entry.path());
      continue;
    }
    if (seal) seal_file(entry.path());
    sync_file(entry.path());
  }
  for (auto it = folders.rbegin(); it != folders.rend(); ++it) {
    sync_folder(*it);
    if (seal && *it != folder) ::chmod(it->c_str(), 0555);
  }
}

/// False when there is a folder of that name already.
bool rename_into(const fs::path& from, const fs::path& to) {
  if (::rename(from.c_str(), to.c_str()) == 0) return true;
  if (errno == EEXIST || errno == ENOTEMPTY) return false;
  throw_errno(to, "rename", errno);
}

}  // namespace

Lock::Lock(Lock&& other) noexcept : descriptor_(other.descriptor_) { other.descriptor_ = -1; }

Lock::~Lock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Store Store::open(const fs::path& folder) {
  const fs::path root = find_root(folder);
  make_root(root);
  follow_group(root);
  check_rights(root);
  if (::access((root / "VERSION").c_str(), F_OK) != 0) make_content(root);
  check_version(root);
  for (const std::string& name : kFolders) {
    if (!is_there(root / name)) make_folder(root / name);
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
bool Store::has_bank(const Id& id) const { return is_there(bank_folder(id)); }
bool Store::has_work(const Id& id) const { return is_there(work_folder(id)); }
fs::path Store::find_folder(const Id& id) const { return has_bank(id) ? bank_folder(id) : work_folder(id); }
std::vector<Id> Store::list_banks() const { return list_ids(root_ / "banks"); }
std::vector<Id> Store::list_work() const { return list_ids(root_ / "work"); }

fs::path Store::input_file(const Id& sha256, const std::string& format) const {
  fs::path file = sharded(root_ / "inputs", sha256);
  const bool is_plain =
      format.size() <= 8 && std::all_of(format.begin(), format.end(), [](unsigned char c) { return std::isalnum(c) != 0; });
  if (!format.empty() && is_plain) file += "." + (format == "tetgen" ? std::string("node") : format);
  return file;
}

fs::path Store::make_temporary() const {
  const process::Identity self = process::find_self();
  std::string host = self.host.substr(0, kMostHostLength);
  std::replace(host.begin(), host.end(), '/', '_');
  std::replace(host.begin(), host.end(), ',', '_');
  const fs::path folder =
      root_ / "tmp" / fmt::format("{},{},{},{},{}", host, self.boot, self.pid, self.start_ticks, make_random_name().substr(0, 12));
  if (::mkdir(folder.c_str(), 0777) != 0) throw_errno(folder, "make this folder", errno);
  return folder;
}

bool Store::publish(const Id& id, const fs::path& folder) const {
  const fs::path target = bank_folder(id);
  const bool is_known = has_bank(id);
  if (!is_known) {
    sync_tree(folder, true);
    make_folder(target.parent_path());
    sync_folder(target.parent_path().parent_path());
  }
  if (is_known || !rename_into(folder, target)) {
    remove_tree(folder);
    return false;
  }
  if (::chmod(target.c_str(), 0555) != 0) throw_errno(target, "make read-only", errno);
  sync_folder(target);
  sync_folder(target.parent_path());
  return true;
}

std::vector<bool> Store::publish_work(const std::vector<Prepared>& prepared) const {
  if (prepared.size() > kFewFolders) {
    sync_file_system(root_ / "tmp");
  } else {
    for (const Prepared& work : prepared) sync_tree(work.folder, false);
  }
  std::vector<bool> was_made;
  std::set<fs::path> parents;
  for (const Prepared& work : prepared) {
    const fs::path target = work_folder(work.id);
    make_folder(target.parent_path());
    parents.insert(target.parent_path());
    was_made.push_back(rename_into(work.folder, target));
    if (!was_made.back()) remove_tree(work.folder);
  }
  for (const fs::path& parent : parents) sync_folder(parent);
  sync_folder(root_ / "work");
  return was_made;
}

void Store::remove_folder(const fs::path& folder) const {
  if (!is_there(folder)) return;
  const fs::path temporary = make_temporary();
  struct stat info {};
  if (::lstat(folder.c_str(), &info) == 0 && (info.st_mode & S_IWUSR) == 0) ::chmod(folder.c_str(), 0755);
  if (::rename(folder.c_str(), (temporary / "removed").c_str()) != 0 && errno != ENOENT) {
    const int error = errno;
    ::chmod(folder.c_str(), info.st_mode & 07777U);
    ::rmdir(temporary.c_str());
    throw_errno(folder, "remove", error);
  }
  sync_folder(folder.parent_path());
  remove_tree(temporary);
}

void Store::remove_work(const Id& id) const { remove_folder(work_folder(id)); }
void Store::remove_bank(const Id& id) const { remove_folder(bank_folder(id)); }

Lock Store::take_lock(int operation) const {
  const fs::path file = root_ / "lock";
  const int fd = ::open(file.c_str(), O_RDONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0664);
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
