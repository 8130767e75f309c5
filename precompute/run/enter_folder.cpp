// Method: openat() component by component with O_NOFOLLOW, then fchdir(): a folder replaced by a link meanwhile is not entered.
// Source: POSIX.1-2008.
#include "precompute/run/enter_folder.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "runtime/base/error.hpp"

namespace carillon::run {

void enter_folder(const std::filesystem::path& root, const std::filesystem::path& name) {
  constexpr int kFolder = O_RDONLY | O_DIRECTORY | O_CLOEXEC;
  std::filesystem::path place = root;
  int folder = ::open(root.c_str(), kFolder);
  const auto refuse = [&](int error, const char* correction) {
    if (folder >= 0) ::close(folder);
    throw SystemError(fmt::format("{}: cannot work in this folder: {}; {}", place.string(), std::strerror(error), correction));
  };
  if (folder < 0) refuse(errno, "check that it exists on every machine of the job");
  for (const std::filesystem::path& step : name) {
    place /= step;
    if (step == ".." || step.is_absolute()) refuse(EINVAL, "name a folder below the first one");
    const int next = ::openat(folder, step.c_str(), kFolder | O_NOFOLLOW);
    const int error = errno;
    if (next < 0)
      refuse(error, error == ENOTDIR || error == ELOOP ? "a link or a file is in its place: remove it" : "check that it exists");
    ::close(folder);
    folder = next;
  }
  if (::fchdir(folder) != 0) refuse(errno, "check its permissions");
  ::close(folder);
}

}  // namespace carillon::run
