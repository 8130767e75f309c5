#include <fmt/core.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "jobs/cli/shared.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxVersionBytes = 4096;

}  // namespace

fs::path find_program(const std::string& name) {
  if (const auto program = base::find_program(name)) return *program;
  throw InputError(fmt::format("{} is neither next to carillon nor in PATH; install it, or put its folder in PATH", name));
}

std::string read_solver_version() {
  const fs::path program = find_program("carillon-precompute");
  const base::Finished finished = base::run({.words = {program, "--version"}, .output = base::kCapture, .errors = base::kInherit},
                                            {.max_bytes = kMaxVersionBytes, .keeps_tail = true});
  const std::string line = finished.output.substr(0, finished.output.find('\n'));
  if (finished.exit_code != 0 || line.empty())
    throw SystemError(fmt::format("{} --version fails (exit code {}); check the installation", program.string(), finished.exit_code));
  return line;
}

void become(const fs::path& program, const std::vector<std::string>& arguments) {
  std::fflush(nullptr);
  std::vector<char*> words{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  ::execv(program.c_str(), words.data());
  throw SystemError(fmt::format("cannot start {}: {}; check the installation", program.string(), std::strerror(errno)));
}

}  // namespace carillon::cli
