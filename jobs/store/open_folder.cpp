// Method:     Every step opens one name inside a descriptor with O_NOFOLLOW, so that no name is looked at first and followed later. Code
//             that knows only paths is given /proc/self/fd/N, which leads to the opened folder and not to its name.
// Source:     openat(2), unlinkat(2), proc(5).
// Deviations: none.
#include "jobs/store/open_folder.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <utility>

#include "jobs/store/files.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/failure.hpp"

namespace carillon::store {
namespace {

namespace fs = std::filesystem;

constexpr int kInside = O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC;
constexpr int kMaxDepth = 100;  // each level takes a descriptor

std::vector<std::string> list_names(int descriptor, const fs::path& name) {
  const int own = ::openat(descriptor, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  DIR* opened = own >= 0 ? ::fdopendir(own) : nullptr;
  if (opened == nullptr) {
    const int error = errno;
    if (own >= 0) ::close(own);
    throw_errno(name, "read this folder", error);
  }
  const std::unique_ptr<DIR, int (*)(DIR*)> folder(opened, ::closedir);
  std::vector<std::string> names;
  while (const dirent* entry = ::readdir(folder.get())) {
    const std::string text = entry->d_name;
    if (text != "." && text != "..") names.push_back(text);
  }
  std::sort(names.begin(), names.end());
  return names;
}

/// A folder of ours may be read-only; what is in it can go only when it is writable.
void remove_below(int parent, const std::string& name, const fs::path& shown, int depth) {
  if (::unlinkat(parent, name.c_str(), 0) == 0 || errno == ENOENT) return;
  if (errno != EISDIR && errno != EPERM && errno != EACCES) throw_errno(shown, "remove", errno);
  int folder = ::openat(parent, name.c_str(), kInside);
  if (folder < 0 && errno == EACCES && ::fchmodat(parent, name.c_str(), 0700, AT_SYMLINK_NOFOLLOW) == 0)
    folder = ::openat(parent, name.c_str(), kInside);
  if (folder < 0) throw_errno(shown, "remove", errno == ENOTDIR || errno == ELOOP ? EPERM : errno);
  try {
    if (depth == 0) throw SystemError(fmt::format("{}: folders lie too deep in each other here; remove them by hand", shown.string()));
    struct stat info {};
    if (::fstat(folder, &info) == 0 && (info.st_mode & S_IRWXU) != S_IRWXU) ::fchmod(folder, 0700);
    for (const std::string& entry : list_names(folder, shown)) remove_below(folder, entry, shown / entry, depth - 1);
  } catch (...) {
    ::close(folder);
    throw;
  }
  ::close(folder);
  if (::unlinkat(parent, name.c_str(), AT_REMOVEDIR) != 0 && errno != ENOENT) throw_errno(shown, "remove", errno);
}

}  // namespace

OpenFolder OpenFolder::open(const fs::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) throw_errno(folder, "open this folder", errno);
  return {descriptor, folder};
}

std::optional<OpenFolder> OpenFolder::find(const std::string& name) const {
  const int descriptor = ::openat(descriptor_, name.c_str(), kInside);
  if (descriptor >= 0) return OpenFolder(descriptor, name_ / name);
  if (errno == ENOENT) return std::nullopt;
  if (errno != ENOTDIR && errno != ELOOP) throw_errno(name_ / name, "open this folder", errno);
  const auto info = look_at(name);
  throw SystemError(fmt::format("{}: {} where the store keeps a folder of its own; remove it, as nothing is read or written through it",
                                (name_ / name).string(), info && S_ISLNK(info->st_mode) ? "a link" : "a file"));
}

OpenFolder OpenFolder::make(const std::string& name) const {
  if (::mkdirat(descriptor_, name.c_str(), 0777) != 0 && errno != EEXIST) throw_errno(name_ / name, "make this folder", errno);
  if (auto made = find(name)) return std::move(*made);
  throw_errno(name_ / name, "make this folder", ENOENT);
}

OpenFolder OpenFolder::make_private(const std::string& name) const {
  if (::mkdirat(descriptor_, name.c_str(), 0700) != 0) throw_errno(name_ / name, "make this folder", errno);
  auto made = find(name);
  struct stat info {};
  // Someone else may have put a folder of their own in its place.
  if (!made || ::fstat(made->get(), &info) != 0 || info.st_uid != ::geteuid())
    throw SystemError(fmt::format("{}: another user replaced this folder of the store while it was being made", (name_ / name).string()));
  ::fchmod(made->get(), 0700 | (info.st_mode & S_ISGID));  // what is made in it belongs to the group of the store
  return std::move(*made);
}

OpenFolder::OpenFolder(OpenFolder&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)), name_(std::move(other.name_)) {}

OpenFolder& OpenFolder::operator=(OpenFolder&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(name_, other.name_);
  return *this;
}

OpenFolder::~OpenFolder() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

fs::path OpenFolder::path() const { return fmt::format("/proc/self/fd/{}", descriptor_); }
fs::path OpenFolder::shared_path() const { return fmt::format("/proc/{}/fd/{}", ::getpid(), descriptor_); }

std::optional<struct stat> OpenFolder::look_at(const std::string& name) const {
  struct stat info {};
  if (::fstatat(descriptor_, name.c_str(), &info, AT_SYMLINK_NOFOLLOW) != 0) return std::nullopt;
  return info;
}

std::vector<std::string> OpenFolder::list() const { return list_names(descriptor_, name_); }
void OpenFolder::remove(const std::string& name) const { remove_below(descriptor_, name, name_ / name, kMaxDepth); }

void OpenFolder::sync() const {
  // A file system without fsync of folders says EINVAL.
  if (::fsync(descriptor_) != 0 && errno != EINVAL) throw_errno(name_, "write", errno);
}

std::string show_names(const OpenFolder& folder, std::string text) {
  for (const std::string& path : {folder.path().string(), folder.shared_path().string()}) {
    for (std::size_t at = text.find(path); at != std::string::npos; at = text.find(path, at)) {
      const char next = at + path.size() < text.size() ? text[at + path.size()] : '/';
      if (next >= '0' && next <= '9') {
        at += path.size();
        continue;
      }
      text.replace(at, path.size(), folder.name().string());
      at += folder.name().string().size();
    }
  }
  return text;
}

void throw_with_names(const OpenFolder& folder, const SystemError& error) {
  const std::string text = show_names(folder, error.what());
  if (dynamic_cast<const DiskFullError*>(&error) != nullptr) throw DiskFullError(text);
  throw SystemError(text);
}

}  // namespace carillon::store
