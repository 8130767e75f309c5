// Environment that must be set before MPI, PETSc and the BLAS are loaded.
#pragma once

#include <filesystem>

namespace carillon::launch {

/// Sets, unless set by the user, for this process and its children:
/// - one BLAS thread and one OpenMP thread per rank (always): the panels of the factor are small, and idle threads slow other ranks;
/// - OPENBLAS_CORETYPE, if OpenBLAS would select kernels for older processors: its releases know processors by number, and treat every
/// later one as a Pentium 4;
/// - the ob1 transport of Open MPI if all ranks are on this host: querying each network library takes 0.2 s;
/// - ranks that wait for others yield their core, except in Slurm jobs, whose cores are exclusive. A single rank does not: MUMPS polls for
/// messages and would lose its core to other programs;
/// - a single rank without a launcher starts isolated: no daemon, no network, no session folder, and 0.15 s less;
/// - HWLOC_COMPONENTS without displays: hwloc opens :0 to :9 to list graphics cards, and Xlib ends the process when such a server ends;
/// - GLIBC_TUNABLES: large allocations request 2 MB pages; K, M and the basis are used completely, and on a virtual machine a fresh 4 kB
/// page costs as much as the computation on it (docs/decisions/launcher.md);
/// - no PETSC_OPTIONS (always): a run depends on its job file and command line only.
void prepare_environment();

/// Preloads `library` in programs started by or replacing this process.
void preload(const std::filesystem::path& library);

}  // namespace carillon::launch
