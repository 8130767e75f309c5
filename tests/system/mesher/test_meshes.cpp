// usage: test_meshes FILE...
//        test_meshes --surfaces SECONDS
// Reads and checks each mesh as the solver does. One line on standard error per refused mesh; exit code 2 if any was refused, 1 if an
// accepted mesh is invalid (volume, node or reference).
//
// --surfaces: for each line of standard input, SURFACE, MESH and options of carillon-mesh with tabs between them, does in a process of its
// own what carillon-mesh --quiet does (--slivers DEG is SurfaceOptions::sliver_deg), ends that after SECONDS of processor time, and reads
// and checks the mesh. Answers with a line on standard output: exit code (less than 0: the signal that ended it; 5: left alone, for there
// would be more than 50,000 nodes), processor seconds, and what was said on standard error, as JSON. Programs under sanitizers take long to
// start; this one starts once.
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/read.hpp"
#include "precompute/mesh/write.hpp"
#include "precompute/mesher/surface.hpp"
#include "runtime/base/error.hpp"

namespace {

using namespace carillon;

/// Fault of an accepted mesh; empty if none.
const char* find_insanity(const char* file) {
  mesh::TetMesh mesh = mesh::read_mesh(file);
  const mesh::CheckReport report = mesh::check_mesh(mesh, file);
  bool sane = report.volume_m3 > 0 && std::isfinite(report.volume_m3) && mesh.tet_count() > 0;
  for (const auto& p : mesh.nodes_m)
    for (const double x : p) sane = sane && std::isfinite(x);
  for (const auto v : mesh.tets) sane = sane && v >= 0 && v < std::ssize(mesh.nodes_m);
  return sane ? nullptr : "insane";
}

int check_meshes(int count, char** files) {
  int code = 0;
  for (int n = 0; n < count; ++n) {
    try {
      const char* insanity = find_insanity(files[n]);
      if (!insanity) continue;
      std::fprintf(stderr, "%s: %s\n", files[n], insanity);
      return 1;
    } catch (const InputError& error) {
      std::fprintf(stderr, "%s\n", error.what());
      code = 2;
    } catch (const SystemError& error) {
      std::fprintf(stderr, "%s\n", error.what());
      code = 2;
    }
  }
  return code;
}

// Limit of nodes: a corner moved kilometres away would make millions.
constexpr long long kMaxNodes = 50'000;
constexpr int kExitLarge = 5;

/// Ends the process if the repaired body will have too many nodes.
void leave_if_large(std::string_view phase) {
  if (!phase.starts_with("about ")) return;
  if (std::stod(std::string(phase.substr(6))) > kMaxNodes) ::_exit(kExitLarge);
}

/// As carillon-mesh SURFACE -o MESH OPTIONS... --quiet; returns its exit code, 1 for an invalid mesh.
int mesh_one(const std::vector<std::string>& words) {
  try {
    mesher::SurfaceOptions options;
    options.surface = words.at(0);
    for (std::size_t n = 2; n < words.size(); ++n) {
      const std::string& word = words[n];
      if (word == "--facets") {
        options.facets = true;
        continue;
      }
      const std::string& value = words.at(++n);
      if (word == "--edge")
        options.edge_m = std::stod(value);
      else if (word == "--wall")
        options.wall_m = std::stod(value);
      else if (word == "--nodes")
        options.nodes = std::stoll(value);
      else if (word == "--order")
        options.order = std::stoi(value);
      else if (word == "--slivers")  // carillon-mesh has no such option: its angle is always that of SurfaceOptions
        options.sliver_deg = std::stod(value);
      else if (word == "--close-holes")
        options.close_holes = std::stod(value);
      else if (word == "--method" && value == "stuffing")
        options.method = mesher::Method::kStuffing;
      else
        throw std::invalid_argument("test_meshes does not know " + word);
    }
    mesher::SurfaceReport report;
    mesh::TetMesh mesh = mesher::mesh_surface(options, report, leave_if_large);
    mesh::check_mesh(mesh, words[1]);
    mesh::write_gmsh(mesh, words[1]);
  } catch (const InputError& error) {
    std::fprintf(stderr, "carillon-mesh: %s\n", error.what());
    return kExitInput;
  } catch (const SolveError& error) {
    std::fprintf(stderr, "carillon-mesh: %s\n", error.what());
    return kExitSolve;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "carillon-mesh: %s\n", error.what());
    return kExitSystem;
  }
  try {
    if (const char* insanity = find_insanity(words[1].c_str())) {
      std::fprintf(stderr, "%s: %s\n", words[1].c_str(), insanity);
      return 1;
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "the mesh that was written is refused: %s\n", error.what());
    return 1;
  }
  return 0;
}

std::string quote(std::FILE* said) {
  std::string text = "\"";
  std::rewind(said);
  for (int c = std::fgetc(said); c != EOF; c = std::fgetc(said)) {
    char code[16];
    // Bytes as numbers: messages may quote arbitrary bytes of the file.
    std::snprintf(code, sizeof code, "\\u%04x", static_cast<unsigned>(c));
    text += c >= 0x20 && c < 0x7f && c != '"' && c != '\\' ? std::string(1, static_cast<char>(c)) : std::string(code);
  }
  return text + '"';
}

int serve(double limit_s) {
  mesher::guard_program("carillon-mesh");
  for (std::string line; std::getline(std::cin, line);) {
    std::vector<std::string> words;
    std::istringstream stream(line);
    for (std::string word; std::getline(stream, word, '\t');) words.push_back(word);
    if (words.size() < 2) return 1;
    std::FILE* said = std::tmpfile();
    if (!said) return 1;
    const pid_t child = ::fork();
    if (child < 0) return 1;
    if (child == 0) {
      const auto limit = static_cast<rlim_t>(std::ceil(limit_s));
      const rlimit cpu{limit + 1, limit + 5};
      // rlimits count whole seconds; this signal resolves fractions.
      const auto whole_s = static_cast<time_t>(limit_s);
      const itimerval timer{{0, 0}, {whole_s, static_cast<suseconds_t>(1e6 * (limit_s - static_cast<double>(whole_s)))}};
      if (limit_s < 1) ::setitimer(ITIMER_PROF, &timer, nullptr);
      ::setrlimit(RLIMIT_CPU, &cpu);
      ::alarm(static_cast<unsigned>(60 * limit));
      ::dup2(::fileno(said), STDERR_FILENO);
      ::dup2(::open("/dev/null", O_WRONLY), STDOUT_FILENO);
      const int code = mesh_one(words);
      std::fflush(nullptr);
      ::_exit(code);
    }
    int status = 0;
    rusage used{};
    if (::wait4(child, &status, 0, &used) != child) return 1;
    const double seconds = static_cast<double>(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                           1e-6 * static_cast<double>(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
    std::printf("[%d, %.3f, %s]\n", WIFSIGNALED(status) ? -WTERMSIG(status) : WEXITSTATUS(status), seconds, quote(said).c_str());
    std::fflush(stdout);
    std::fclose(said);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[1]) == "--surfaces") return serve(std::stod(argv[2]));
  return check_meshes(argc - 1, argv + 1);
}
