#include <fmt/core.h>

#include <string>
#include <vector>

#include "jobs/cli/shared.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/environment.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxVersionBytes = 4096;

}  // namespace

std::string read_solver_version() { return read_program_version("carillon-precompute"); }

std::string read_program_version(const std::string& name) {
  const fs::path program = base::require_program(name);
  const base::Finished finished = base::run({.words = {program, "--version"}, .output = base::kCapture, .errors = base::kInherit},
                                            {.max_bytes = kMaxVersionBytes, .keeps_tail = true});
  const std::string line = finished.output.substr(0, finished.output.find('\n'));
  if (finished.exit_code != 0 || line.empty())
    throw SystemError(fmt::format("{} --version fails (exit code {}); check the installation", program.string(), finished.exit_code));
  return line;
}

void become(const std::string& program, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), base::require_program(program).string());
  // Started outside of an MPI run of this process.
  base::become(arguments, program == "carillon-study" ? base::make_environment() : base::make_lone_environment());
}

}  // namespace carillon::cli
