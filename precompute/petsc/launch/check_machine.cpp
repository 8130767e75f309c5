#include "precompute/petsc/launch/check_machine.hpp"

#include <fmt/core.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>

#include "runtime/base/error.hpp"

namespace carillon::launch {
namespace {

constexpr rlim_t kFileBytes = 8U << 20;  // Open MPI starts within 4.2 MB; its largest file is memory shared by two ranks

}  // namespace

void check_machine() {
  std::error_code error;
  std::string probe = (std::filesystem::temp_directory_path(error) / "carillon-XXXXXX").string();
  if (!error) {  // Open MPI creates a missing folder, or uses another
    if (::mkdtemp(probe.data()) == nullptr)
      throw SystemError(fmt::format("{}: cannot create temporary files: {}; free space there, or set TMPDIR to another folder",
                                    std::filesystem::path(probe).parent_path().string(), std::strerror(errno)));
    ::rmdir(probe.c_str());
  }
  rlimit limit{};
  if (::getrlimit(RLIMIT_FSIZE, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY && limit.rlim_cur < kFileBytes)
    throw SystemError(fmt::format("the file size limit is {} bytes (ulimit -f, in KiB), too low for MPI to start; raise it to {} MiB",
                                  limit.rlim_cur, kFileBytes >> 20));
}

}  // namespace carillon::launch
