// carillon-precompute, as started by users and mpirun: prepares the environment before MPI starts, then becomes the solver.
#include <fmt/core.h>

#include <algorithm>
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
    words.at(0) = base::find_helper("carillon-precompute").string();
    base::become(words);
  } catch (const std::exception& error) {
    fmt::print(stderr, "carillon-precompute: error: {}\n", base::show_message(error.what()));
    return kExitSystem;
  }
}
