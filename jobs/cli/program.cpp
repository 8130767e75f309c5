// Programs beside this one. Nothing here goes through a shell.
#include <fcntl.h>
#include <fmt/core.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <sstream>

#include "jobs/cli/shared.hpp"
#include "runtime/config/error.hpp"

extern char** environ;

namespace carillon::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostVersionBytes = 4096;

bool is_program(const fs::path& file) {
  std::error_code error;
  return fs::is_regular_file(file, error) && ::access(file.c_str(), X_OK) == 0;
}

std::vector<char*> make_argv(const fs::path& program, const std::vector<std::string>& arguments) {
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  return argv;
}

/// What the program prints on standard output, at most `most` bytes; its exit status in `status`.
std::string read_output(const fs::path& program, const std::vector<std::string>& arguments, std::size_t most, int& status) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0)
    throw SystemError(fmt::format("cannot start {}: {}; close other programs", program.string(), std::strerror(errno)));
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  pid_t child = 0;
  const int error = ::posix_spawn(&child, program.c_str(), &actions, nullptr, make_argv(program, arguments).data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  std::string text;
  char piece[1024];
  for (ssize_t got = 1; error == 0 && got > 0;) {
    got = ::read(ends[0], piece, sizeof piece);
    if (got < 0 && errno == EINTR)
      got = 1;
    else if (got > 0 && text.size() < most)
      text.append(piece, static_cast<std::size_t>(got));
  }
  ::close(ends[0]);
  if (error != 0) throw SystemError(fmt::format("cannot start {}: {}; check the installation", program.string(), std::strerror(error)));
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return text;
}

}  // namespace

fs::path find_program(const std::string& name) {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  if (!error && is_program(self.parent_path() / name)) return self.parent_path() / name;
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "/usr/local/bin:/usr/bin:/bin");
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (!folder.empty() && is_program(fs::path(folder) / name)) return fs::absolute(fs::path(folder) / name);
  }
  throw InputError(fmt::format("{} is neither beside carillon nor in PATH; install it, or put its folder in PATH", name));
}

std::string read_solver_version() {
  const fs::path program = find_program("carillon-precompute");
  int status = 0;
  const std::string text = read_output(program, {"--version"}, kMostVersionBytes, status);
  const std::string line = text.substr(0, text.find('\n'));
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || line.empty())
    throw SystemError(fmt::format("{} --version fails (status {}); check the installation", program.string(), status));
  return line;
}

void become(const fs::path& program, const std::vector<std::string>& arguments) {
  std::fflush(nullptr);
  ::execv(program.c_str(), make_argv(program, arguments).data());
  throw SystemError(fmt::format("cannot start {}: {}; check the installation", program.string(), std::strerror(errno)));
}

}  // namespace carillon::cli
