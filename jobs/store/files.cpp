#include "jobs/store/files.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "runtime/base/failure.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/message.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

void sync_path(const fs::path& path, int flags, int (*sync)(int)) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | flags);
  if (fd < 0) throw_errno(path, "open", errno);
  const int error = sync(fd) == 0 ? 0 : errno;
  ::close(fd);
  // A file system without fsync of folders says EINVAL.
  if (error != 0 && error != EINVAL) throw_errno(path, "write", error);
}

}  // namespace

void sync_file(const fs::path& file) { sync_path(file, 0, ::fsync); }
void sync_folder(const fs::path& folder) { sync_path(folder, O_DIRECTORY, ::fsync); }

void make_folder(const fs::path& folder) {
  if (::mkdir(folder.c_str(), 0777) != 0 && errno != EEXIST) throw_errno(folder, "make this folder", errno);
}

void throw_errno(const fs::path& path, const std::string& verb, int error) {
  const char* advice = error != EFBIG && base::is_full_error(error)          ? kFullAdvice
                       : error == EACCES || error == EPERM || error == EROFS ? "check owner, group and rights"
                                                                             : base::find_advice(error);
  throw_system_error(error, fmt::format("{}: cannot {}: {}; {}", path.string(), verb, std::strerror(error), advice));
}

bool append_text(const fs::path& file, const std::string& text) {
  const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666);
  if (fd < 0) return false;
  struct stat info {};
  const bool is_ours = ::fstat(fd, &info) == 0 && S_ISREG(info.st_mode) && info.st_nlink == 1;
  const bool is_written = is_ours && ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
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
