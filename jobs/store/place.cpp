// Location of the registry: SQLite's WAL needs shared memory, so it is never on a network file system.
#include <fmt/core.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <map>

#include "jobs/store/files.hpp"
#include "jobs/store/store.hpp"
#include "runtime/base/error.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

/// Magic numbers: statfs(2), linux/magic.h.
const std::map<unsigned long, const char*> kShared{
    {0x6969, "nfs"},      {0x517B, "smb"},          {0xFF534D42, "cifs"},  {0xFE534D42, "smb2"}, {0x0BD00BD0, "lustre"},
    {0x47504653, "gpfs"}, {0x19830326, "beegfs"},   {0x00C36400, "ceph"},  {0x5346414F, "afs"},  {0x6B414653, "afs"},
    {0x01021997, "9p"},   {0x65735546, "fuse"},     {0x7461636F, "ocfs2"}, {0x01161970, "gfs2"}, {0xAAD7AAEA, "panfs"},
    {0x73757245, "coda"}, {0x20030528, "orangefs"}, {0x013661, "scalefs"}};

fs::path find_state_home() {
  const char* state = std::getenv("XDG_STATE_HOME");
  if (state != nullptr && fs::path(state).is_absolute()) return state;
  const char* home = std::getenv("HOME");
  return home != nullptr && fs::path(home).is_absolute() ? fs::path(home) / ".local/state" : fs::path();
}

/// The nearest existing parent.
fs::path find_existing(fs::path folder) {
  std::error_code error;
  while (!fs::exists(folder, error) && folder.has_relative_path()) folder = folder.parent_path();
  return folder;
}

/// A folder in the world-writable /var/tmp. SystemError if it exists and belongs neither to this user nor to the group of the store.
fs::path make_local_folder(const fs::path& folder, const fs::path& root) {
  struct stat info {
  }, store{};
  if (::stat(root.c_str(), &store) != 0) throw_errno(root, "read", errno);
  const bool is_group = (store.st_mode & S_IWGRP) != 0;
  if (::mkdir(folder.c_str(), 0700) == 0) {
    if (is_group && (::chown(folder.c_str(), static_cast<uid_t>(-1), store.st_gid) != 0 || ::chmod(folder.c_str(), 02770) != 0))
      throw_errno(folder, "give to the group of the store", errno);
  } else if (errno != EEXIST) {
    throw_errno(folder, "create this folder", errno);
  }
  if (::lstat(folder.c_str(), &info) != 0) throw_errno(folder, "read", errno);
  const bool is_ours = info.st_uid == ::geteuid() || (is_group && info.st_gid == store.st_gid && info.st_uid != 0);
  if (!S_ISDIR(info.st_mode) || !is_ours || (info.st_mode & S_IWOTH) != 0)
    throw SystemError(
        fmt::format("{}: the folder for the registry of {} belongs to another user; set XDG_STATE_HOME to a folder on a local disk",
                    folder.string(), root.string()));
  return folder;
}

}  // namespace

std::string find_network_file_system(const fs::path& folder) {
  struct statfs info {};
  if (::statfs(folder.c_str(), &info) != 0) return "";
  const auto found = kShared.find(static_cast<unsigned long>(info.f_type) & 0xFFFFFFFFUL);
  return found == kShared.end() ? "" : found->second;
}

fs::path Store::registry_folder() const {
  if (find_network_file_system(root_).empty()) return root_;
  std::error_code error;
  const fs::path real = fs::canonical(root_, error);
  const std::string name = "carillon-" + hash_text(error ? root_.string() : real.string()).short_text();
  struct stat info {};
  const bool is_group = ::stat(root_.c_str(), &info) == 0 && (info.st_mode & S_IWGRP) != 0;
  const fs::path home = is_group ? fs::path() : find_state_home();
  if (home.empty() || !find_network_file_system(find_existing(home)).empty()) return make_local_folder(fs::path("/var/tmp") / name, root_);
  fs::create_directories(home / "carillon" / name, error);
  if (error) throw_errno(home / "carillon" / name, "create this folder", error.value());
  return home / "carillon" / name;
}

}  // namespace carillon::store
