#include "jobs/store/files.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "runtime/base/error.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/message.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

void sync_path(const fs::path& path, int flags, int (*sync)(int)) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | flags);
  if (fd < 0) throw_errno(path, "open", errno);
  const int error = sync(fd) == 0 ? 0 : errno;
  ::close(fd);
  // EINVAL: the file system has no fsync of folders.
  if (error != 0 && error != EINVAL) throw_errno(path, "write", error);
}

}  // namespace

void sync_file(const fs::path& file) { sync_path(file, 0, ::fsync); }
void sync_folder(const fs::path& folder) { sync_path(folder, O_DIRECTORY, ::fsync); }

void sync_tree(const fs::path& folder, bool seal) {
  for (const std::string& name : list_names(folder)) {
    const fs::path path = folder / name;
    const fs::file_status status = fs::symlink_status(path);
    if (fs::is_directory(status)) {
      sync_tree(path, seal);
      if (seal) ::chmod(path.c_str(), 0555);
    } else if (!fs::is_regular_file(status)) {
      throw SystemError(fmt::format("{}: not a regular file; remove it", path.string()));
    } else if (seal) {
      seal_file(path);
    } else {
      sync_file(path);
    }
  }
  sync_folder(folder);
}

void seal_file(const fs::path& file) {
  if (::chmod(file.c_str(), 0444) != 0) {
    if (errno != EPERM) throw_errno(file, "make read-only", errno);
    const fs::path copy = fs::path(file) += ".copy";
    std::error_code error;
    fs::copy_file(file, copy, fs::copy_options::overwrite_existing, error);
    if (error) throw_errno(file, "copy", error.value());
    if (::chmod(copy.c_str(), 0444) != 0 || ::rename(copy.c_str(), file.c_str()) != 0) throw_errno(file, "copy", errno);
  }
  sync_file(file);
}

void make_folder(const fs::path& folder) {
  if (::mkdir(folder.c_str(), 0777) != 0 && errno != EEXIST) throw_errno(folder, "create this folder", errno);
}

std::vector<std::string> list_names(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    names.push_back(it->path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

void remove_tree(const fs::path& path) {
  std::error_code error;
  fs::remove_all(path, error);
  if (!error) return;
  // Entries of a read-only folder cannot be removed.
  fs::permissions(path, fs::perms::owner_all, fs::perm_options::add, error);
  error.clear();
  for (fs::recursive_directory_iterator it(path, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (fs::is_directory(it->symlink_status(ignored))) fs::permissions(it->path(), fs::perms::owner_all, fs::perm_options::add, ignored);
  }
  fs::remove_all(path, error);
  if (error) throw_errno(path, "remove", error.value());
}

void throw_errno(const fs::path& path, const std::string& verb, int error) {
  const char* advice = error != EFBIG && base::is_full_error(error)          ? kFullAdvice
                       : error == EACCES || error == EPERM || error == EROFS ? "check owner, group and rights"
                                                                             : base::find_advice(error);
  throw_system_error(error, fmt::format("{}: cannot {}: {}; {}", path.string(), verb, std::strerror(error), advice));
}

bool append_text(const fs::path& file, const std::string& text) {
  const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (fd < 0) return false;
  const bool is_written = ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  ::close(fd);
  return is_written;
}

bool is_disk_full(const fs::path& folder, const std::exception& error) {
  const auto* file_error = dynamic_cast<const fs::filesystem_error*>(&error);
  return is_disk_full(folder) || dynamic_cast<const DiskFullError*>(&error) != nullptr ||
         (file_error != nullptr && base::is_full_error(file_error->code().value()));
}

bool is_disk_full(const fs::path& folder) {
  constexpr double kFullBytes = 1 << 20;
  struct statvfs info {};
  if (::statvfs(folder.c_str(), &info) != 0) return false;
  return static_cast<double>(info.f_bavail) * static_cast<double>(info.f_frsize) < kFullBytes;
}

}  // namespace carillon::store
