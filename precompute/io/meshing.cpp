#include "precompute/io/meshing.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <string_view>
#include <vector>

#include "precompute/io/interrupt.hpp"
#include "precompute/mesh/read.hpp"
#include "precompute/shapes/shapes.hpp"
#include "runtime/config/document.hpp"

extern char** environ;

namespace carillon::io {
namespace {

namespace fs = std::filesystem;

// Beyond the time for the mesh: for the surface as it was read, should its repair not end, and for its reading.
constexpr double kLonger = 1.2, kRoughSeconds = 1.5, kReadSeconds = 2.5, kLeastReadSeconds = 8;

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
  std::string errors;    // what it wrote to standard error, its end
  bool is_late = false;  // it was ended for taking longer than it might
};

/// Starts a program, waits for it and keeps the end of its standard error. Once `may_stop` says so it is ended; that is asked every tenth
/// of a second.
Ended run_program(const std::vector<std::string>& words, Cleanup& cleanup, const std::function<bool(const std::string& errors)>& may_stop) {
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
    if (may_stop) {
      pollfd waiting{pipe.ends[0], POLLIN, 0};
      constexpr int kAskMs = 100;
      if (::poll(&waiting, 1, kAskMs) == 0) {
        if (!ended.is_late && may_stop(ended.errors)) {
          ended.is_late = true;
          ::kill(child, SIGKILL);
        }
        continue;
      }
    }
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

// What carillon-mesh --estimate tells, each on a line of its own, before an object.
constexpr std::string_view kRoughWord = "rough {", kEstimateWord = "estimate {", kInsteadWord = "instead {";

bool has_told(const std::string& errors, std::string_view word) {
  return errors.starts_with(word) || errors.find("\n" + std::string(word)) != std::string::npos;
}

/// The object of the line that begins with `word`, which is taken away.
std::optional<config::Document> take_told(std::string& errors, std::string_view word) {
  if (!has_told(errors, word)) return std::nullopt;
  const std::size_t begin = errors.starts_with(word) ? 0 : errors.find("\n" + std::string(word)) + 1;
  const std::size_t end = std::min(errors.find('\n', begin), errors.size());
  const std::size_t brace = begin + word.size() - 1;
  const std::string text = errors.substr(brace, end - brace);
  errors.erase(begin, end + 1 - begin);
  return config::parse_document(text, "carillon-mesh --estimate");
}

constexpr std::int64_t kMostCount = 1'000'000'000'000'000;

std::optional<BodyEstimate> take_estimate(std::string& errors, std::string_view word) {
  std::optional<config::Document> told = take_told(errors, word);
  if (!told) return std::nullopt;
  config::Object root = told->root();
  BodyEstimate estimate;
  estimate.volume_m3 = root.number("volume_m3", config::kPositive);
  estimate.area_m2 = root.number("area_m2", config::kPositive);
  estimate.thickness_m = root.number("thickness_m", config::kPositive);
  estimate.nodes = root.integer("nodes", 1, kMostCount);
  estimate.is_rough = word == kRoughWord;
  return estimate;
}

mesh::TetMesh mesh_surface(const spec::Body& body, int order, const Fineness& fineness, Patience* patience) {
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
  if (body.close_holes) add("--close-holes", format_length(*body.close_holes));
  add("--up", std::string(1, body.up));
  add("--method", body.method);
  if (fineness.nodes) add("--nodes", std::to_string(*fineness.nodes));
  if (fineness.edge_m) add("--edge", format_length(*fineness.edge_m));
  std::function<bool(const std::string&)> may_stop;
  double most_s = 0;
  if (patience != nullptr) {
    words.push_back("--estimate");
    most_s = std::max(kLonger * patience->seconds + kReadSeconds, kLeastReadSeconds);
    may_stop = [seconds = patience->seconds, most_s, start = std::chrono::steady_clock::now()](const std::string& errors) {
      const double taken = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      if (taken > seconds && has_told(errors, kEstimateWord)) return true;
      return taken > most_s || (taken > kLonger * seconds + kRoughSeconds && has_told(errors, kRoughWord));
    };
  }
  Ended ended = run_program(words, cleanup, may_stop);
  if (patience != nullptr) {
    const std::optional<BodyEstimate> rough = take_estimate(ended.errors, kRoughWord), good = take_estimate(ended.errors, kEstimateWord);
    if (std::optional<config::Document> instead = take_told(ended.errors, kInsteadWord))
      patience->possible_nodes = instead->root().integer("nodes", 1, kMostCount);
    if (ended.is_late) {
      if (!good && !rough)
        throw InputError(fmt::format(
            "{}: the surface is not even read after {:.0f} s; give more time (--patience), decimate it, or mesh it beforehand by "
            "carillon-mesh and name the \"mesh\"",
            body.place, most_s));
      patience->estimate = good ? good : rough;
      return {};
    }
  }
  if (WIFEXITED(ended.status) && WEXITSTATUS(ended.status) == 0) return mesh::read_mesh(file);
  const std::string failed = fmt::format("{}: the body cannot be meshed", body.place);
  const std::string text = fmt::format("{}: {}", failed, ended.errors.empty() ? "carillon-mesh gave no reason" : ended.errors);
  if (WIFEXITED(ended.status) && WEXITSTATUS(ended.status) == kExitInput) throw InputError(text);
  if (!WIFSIGNALED(ended.status)) throw SystemError(text);
  const int signal = WTERMSIG(ended.status);
  // It says itself where it broke down, if it still can; a signal that it sends itself comes from the surface, one from outside does not.
  const bool is_own =
      signal == SIGSEGV || signal == SIGBUS || signal == SIGABRT || signal == SIGFPE || signal == SIGILL || signal == SIGXCPU;
  const std::string said = ended.errors.empty() ? "" : fmt::format(" after it wrote '{}'", ended.errors);
  if (is_own)
    throw InputError(
        fmt::format("{}: carillon-mesh crashed on {}, by signal {} ({}){}; ask for another number of nodes, try \"method\": "
                    "\"stuffing\", or repair the surface in a modeller",
                    failed, body.surface.string(), signal, ::strsignal(signal), said));
  throw SystemError(fmt::format("{}: carillon-mesh was ended from outside, by signal {} ({}){}; did memory run out?", failed, signal,
                                ::strsignal(signal), said));
}

}  // namespace

mesh::TetMesh make_body_mesh(const spec::Body& body, int order, const Fineness& fineness, Patience* patience) {
  if (body.shape.empty()) return mesh_surface(body, order, fineness, patience);
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
