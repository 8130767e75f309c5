#include "runtime/base/standard_output.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace carillon::base {

bool is_standard_output(const std::filesystem::path& file) { return file == "-"; }

void check_standard_output(std::string_view what) {
  if (::isatty(STDOUT_FILENO) == 1)
    throw InputError(fmt::format("-: the {} is no text for a terminal; send standard output to a file or another program", what));
}

void write_standard_output(std::string_view bytes) {
  errno = 0;
  if (std::fwrite(bytes.data(), 1, bytes.size(), stdout) != bytes.size() || std::fflush(stdout) != 0)
    throw SystemError(fmt::format("standard output cannot be written: {}", std::strerror(errno)));
}

}  // namespace carillon::base
