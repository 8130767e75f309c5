// LD_PRELOAD library: once the temporary file of a checkpoint exists, its name is redirected to another file, as if another user with write
// access to the folder had replaced it.
#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

int open_and_replace(const char* name, int flags, unsigned mode) {
  using Open = int (*)(const char*, int, ...);
  const auto open = reinterpret_cast<Open>(::dlsym(RTLD_NEXT, "open"));
  const int file = open(name, flags, mode);
  const char* slash = std::strrchr(name, '/');
  const char* victim = std::getenv("CARILLON_TEST_VICTIM");
  if (file < 0 || (flags & O_CREAT) == 0 || victim == nullptr || std::strcmp(slash != nullptr ? slash + 1 : name, ".state.new") != 0)
    return file;
  char aside[4096];
  std::snprintf(aside, sizeof aside, "%s.taken", name);
  if (::rename(name, aside) != 0 || ::symlink(victim, name) != 0) std::abort();
  return file;
}

}  // namespace

extern "C" int open(const char* name, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const bool has_mode = (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE;
  const unsigned mode = has_mode ? va_arg(list, unsigned) : 0;
  va_end(list);
  return open_and_replace(name, flags, mode);
}

/// The same for 64-bit systems, where a file's length needs no other call.
extern "C" int open64(const char* name, int flags, ...) __attribute__((alias("open")));
