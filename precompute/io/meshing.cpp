#include "precompute/io/meshing.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <vector>

#include "precompute/io/interrupt.hpp"
#include "precompute/mesh/read.hpp"
#include "precompute/shapes/shapes.hpp"
#include "runtime/config/error.hpp"

extern char** environ;

namespace carillon::io {
namespace {

namespace fs = std::filesystem;

/// Ends of a pipe that close themselves.
struct Pipe {
  Pipe() {
    if (::pipe2(ends, O_CLOEXEC) != 0) throw SystemError(fmt::format("no pipe to carillon-mesh: {}", std::strerror(errno)));
  }
  ~Pipe() {
    close_writer();
    ::close(ends[0]);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  void close_writer() {
    if (ends[1] >= 0) ::close(ends[1]);
    ends[1] = -1;
  }
  int ends[2] = {-1, -1};
};

struct Ended {
  int status = 0;
  std::string errors;  // what it wrote to standard error, its end
};

/// Starts a program, waits for it and keeps the end of its standard error.
Ended run_program(const std::vector<std::string>& words, Cleanup& cleanup) {
  Pipe pipe;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, pipe.ends[1], STDERR_FILENO);
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  pid_t child = 0;
  const int failed = posix_spawn(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0)
    throw SystemError(fmt::format("{}: cannot be started ({}); it belongs beside this program", words[0], std::strerror(failed)));
  cleanup.set_child(child);
  pipe.close_writer();
  Ended ended;
  constexpr std::size_t kKept = 4096;
  std::array<char, 1024> buffer{};
  for (;;) {
    const ssize_t got = ::read(pipe.ends[0], buffer.data(), buffer.size());
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    ended.errors.append(buffer.data(), static_cast<std::size_t>(got));
    if (ended.errors.size() > 2 * kKept) ended.errors.erase(0, ended.errors.size() - kKept);
  }
  while (::waitpid(child, &ended.status, 0) < 0 && errno == EINTR) {
  }
  cleanup.set_child(0);
  while (!ended.errors.empty() && ended.errors.back() == '\n') ended.errors.pop_back();
  return ended;
}

fs::path find_mesher() {
  std::error_code error;
  const fs::path self = fs::read_symlink("/proc/self/exe", error);
  return self.parent_path() / "carillon-mesh";
}

std::string format_length(double metres) { return fmt::format("{:.17g}", metres); }

mesh::TetMesh mesh_surface(const spec::Body& body, int order, const Fineness& fineness) {
  std::string folder = (fs::temp_directory_path() / "carillon-mesh-XXXXXX").string();
  if (::mkdtemp(folder.data()) == nullptr)
    throw SystemError(fmt::format("{}: cannot make a temporary folder: {}", folder, std::strerror(errno)));
  const std::string file = folder + "/body.msh";
  Cleanup cleanup(file);
  std::vector<std::string> words{find_mesher().string(), body.surface.string(), "-o", file, "--order", std::to_string(order), "--quiet"};
  const auto add = [&](const char* option, const std::string& value) {
    words.push_back(option);
    words.push_back(value);
  };
  if (body.wall_m) add("--wall", format_length(*body.wall_m));
  if (body.height_m) add("--height", format_length(*body.height_m));
  if (body.scale) add("--scale", format_length(*body.scale));
  add("--up", std::string(1, body.up));
  add("--method", body.method);
  if (fineness.nodes) add("--nodes", std::to_string(*fineness.nodes));
  if (fineness.edge_m) add("--edge", format_length(*fineness.edge_m));
  const Ended ended = run_program(words, cleanup);
  if (WIFEXITED(ended.status) && WEXITSTATUS(ended.status) == 0) return mesh::read_mesh(file);
  const std::string text = fmt::format("{}: the body cannot be meshed: {}", body.place, ended.errors);
  if (WIFEXITED(ended.status) && WEXITSTATUS(ended.status) == kExitInput) throw InputError(text);
  if (!WIFSIGNALED(ended.status)) throw SystemError(text);
  const int signal = WTERMSIG(ended.status);
  const char* name = sigdescr_np(signal);
  const std::string what =
      fmt::format("{}{}signal {} ({})", text, ended.errors.empty() ? "" : "; ", signal, name != nullptr ? name : "unknown");
  // A signal of its own making comes from what it read, and comes again; others come from outside.
  for (const int own : {SIGSEGV, SIGABRT, SIGBUS, SIGFPE, SIGILL, SIGSYS, SIGTRAP}) {
    if (signal == own)
      throw InputError(what +
                       " ended carillon-mesh: this surface is malformed in a way that it does not withstand; repair the surface, "
                       "or write it from another program as STL, OBJ, OFF or PLY");
  }
  throw SystemError(what + " ended carillon-mesh");
}

}  // namespace

mesh::TetMesh make_body_mesh(const spec::Body& body, int order, const Fineness& fineness) {
  if (body.shape.empty()) return mesh_surface(body, order, fineness);
  shapes::ShapeOptions options{.shape = body.shape, .dimensions = body.dimensions, .order = order};
  options.target_nodes = fineness.nodes;
  options.edge_m = fineness.edge_m;
  try {
    return shapes::make_shape(options);
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}: key 'body': {}", body.place, error.what()));
  }
}

std::string describe(const spec::Body& body, const Fineness& fineness) {
  const std::string name = body.shape.empty() ? body.surface.string() : body.shape;
  if (fineness.nodes) return fmt::format("{}, {} nodes wanted", name, *fineness.nodes);
  if (fineness.edge_m) return fmt::format("{}, edges of {:.4g} m", name, *fineness.edge_m);
  return name;
}

}  // namespace carillon::io
