// What has to be in the environment before MPI, PETSc and the BLAS are loaded.
#pragma once

#include <filesystem>

namespace carillon::launch {

/// Sets, where the user has not:
/// - one BLAS thread and one OpenMP thread a rank (always): the panels of the factor are small, and idle threads would slow other ranks;
/// - OPENBLAS_CORETYPE, where OpenBLAS would take kernels for older processors than this one: its releases know processors by number, and
///   every later one is a Pentium 4 to them;
/// - Open MPI's transport ob1, where all ranks are on this host: asking each network library takes 0.2 s;
/// - one rank without a launcher starts by itself: no daemon, no network, no session folder, and 0.15 s less;
/// - HWLOC_COMPONENTS without displays: hwloc opens :0 to :9 to list graphics cards, and Xlib ends the process when such a server ends;
/// - GLIBC_TUNABLES: large allocations ask for pages of 2 MB; K, M and the basis are touched from end to end, and on a virtual machine a
///   fresh page of 4 kB cost as much as all that is done with it (docs/decisions/launcher.md);
/// - no PETSC_OPTIONS (always): what a run does is in its job file and its command line.
/// For this process and those it starts or becomes.
void prepare_environment();

/// Has the programs that this one becomes load `library` before all others.
void preload(const std::filesystem::path& library);

}  // namespace carillon::launch
