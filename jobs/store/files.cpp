#include "jobs/store/files.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "runtime/config/error.hpp"

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
void sync_file_system(const fs::path& folder) { sync_path(folder, O_DIRECTORY, ::syncfs); }

void make_folder(const fs::path& folder) {
  if (::mkdir(folder.c_str(), 0777) != 0 && errno != EEXIST) throw_errno(folder, "make this folder", errno);
}

void throw_errno(const fs::path& path, const std::string& verb, int error) {
  const char* mend = error == ENOSPC || error == EDQUOT                    ? "make room on the disk and try again"
                     : error == EACCES || error == EPERM || error == EROFS ? "check owner, group and rights"
                                                                           : "check the disk";
  throw SystemError(fmt::format("{}: cannot {}: {}; {}", path.string(), verb, std::strerror(error), mend));
}

void remove_tree(const fs::path& folder) {
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder, fs::directory_options::none, error), end; !error && it != end; it.increment(error)) {
    if (it->is_directory(error) && !it->is_symlink(error)) ::chmod(it->path().c_str(), 0700);
  }
  fs::remove_all(folder, error);
  if (error) throw_errno(folder, "remove", error.value());
}

}  // namespace carillon::store
