// carillon-precompute, as started by users and mpirun: prepares the environment before MPI starts, then becomes the solver; with --worker
// as the first word, the worker of the queue (jobs/queue/worker).
#include <fmt/core.h>

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

#include "precompute/petsc/launch/check_machine.hpp"
#include "precompute/petsc/launch/environment.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file_limit.hpp"
#include "runtime/base/message.hpp"
#include "runtime/base/printable.hpp"

int main(int argc, char** argv) {
  using namespace carillon;
  try {
    char** const own_end = std::find(argv, argv + argc, std::string_view("--"));  // the rest is for PETSc and SLEPc
    base::report_file_limit();
    launch::check_machine();
    launch::prepare_environment();
    if (std::find(argv, own_end, std::string_view("--profile")) != own_end)
      launch::preload(base::find_helper("libcarillon_mpi_profile.so"));
    // Keeps the typed name in process lists: the solver has the same file name as the launcher.
    std::vector<std::string> words(argv, argv + argc);
    const bool is_worker = argc > 1 && std::string_view(argv[1]) == "--worker";
    if (is_worker) ::setenv("LD_BIND_NOW", "1", 1);  // else every fork looks up the functions that it calls
    words.at(0) = base::find_helper(is_worker ? "carillon-worker" : "carillon-precompute").string();
    base::become(words);
  } catch (const std::exception& error) {
    fmt::print(stderr, "carillon-precompute: error: {}\n", base::show_message(error.what()));
    return kExitSystem;
  }
}
