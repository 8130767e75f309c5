#include "jobs/store/seal.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>

#include <cerrno>

#include "jobs/store/files.hpp"
#include "runtime/base/error.hpp"

namespace carillon::store {

namespace {
constexpr off_t kMaxCopiedBytes = 16 << 20;
}

int open_regular(const OpenFolder& folder, const char* name) {
  const int file = ::openat(folder.get(), name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
  struct stat info {};
  if (file < 0 || (::fstat(file, &info) == 0 && S_ISREG(info.st_mode))) return file;
  ::close(file);
  errno = EINVAL;
  return -1;
}

void seal_file(const OpenFolder& folder, const std::string& name) {
  File file{open_regular(folder, name.c_str())};
  if (file.value < 0) throw_errno(folder.name() / name, "read", errno);
  struct stat info {};
  if (::fstat(file.value, &info) != 0) throw_errno(folder.name() / name, "read", errno);
  const bool is_shared = info.st_nlink > 2 || (info.st_nlink > 1 && info.st_size < kMaxCopiedBytes) || info.st_uid != ::geteuid();
  if (is_shared || ::fchmod(file.value, 0444) != 0) {
    const std::string copy = name.substr(0, 200) + ".copy";
    folder.remove(copy);
    const File target{::openat(folder.get(), copy.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600)};
    if (target.value < 0) throw_errno(folder.name() / name, "copy", errno);
    std::string piece(1 << 20, '\0');
    for (ssize_t got = 0; (got = ::read(file.value, piece.data(), piece.size())) != 0;) {
      if (got < 0) throw_errno(folder.name() / name, "read", errno);
      for (ssize_t done = 0; done < got;) {
        const ssize_t put = ::write(target.value, piece.data() + done, static_cast<std::size_t>(got - done));
        if (put <= 0) throw_errno(folder.name() / name, "copy", put < 0 ? errno : ENOSPC);
        done += put;
      }
    }
    if (::fchmod(target.value, 0444) != 0 || ::fsync(target.value) != 0 ||
        ::renameat(folder.get(), copy.c_str(), folder.get(), name.c_str()) != 0)
      throw_errno(folder.name() / name, "copy", errno);
    return;
  }
  if (::fsync(file.value) != 0 && errno != EINVAL) throw_errno(folder.name() / name, "write", errno);
}

void sync_tree(const OpenFolder& folder, bool seal) {
  for (const std::string& name : folder.list()) {
    const auto info = folder.look_at(name);
    if (info && S_ISDIR(info->st_mode)) {
      const auto inner = folder.find(name);
      sync_tree(*inner, seal);
      if (seal) ::fchmod(inner->get(), 0555);
    } else if (!info || !S_ISREG(info->st_mode)) {
      throw SystemError(fmt::format("{}: no regular file among the results; remove it", (folder.name() / name).string()));
    } else if (seal) {
      seal_file(folder, name);
    } else {
      sync_file(folder.path() / name);
    }
  }
  folder.sync();
}

}  // namespace carillon::store
