// Source: PETSc users manual 3.18, PetscGetFlops; message counts: precompute/petsc/profile.
#include "precompute/petsc/work.hpp"

#include <dlfcn.h>
#include <petscsys.h>

#include "precompute/petsc/mpi_counts.hpp"
#include "runtime/base/clock.hpp"

namespace carillon::petsc {
namespace {

WorkTable totals{};
PhaseWork* phase_at_hand = totals.data();
double petsc_flops = 0;  // counted so far

/// PETSc counts operations itself; those since the last call belong to the current phase.
void book_petsc_flops() {
  PetscLogDouble all = 0;
  if (PetscInitializeCalled == PETSC_FALSE || PetscGetFlops(&all) != 0) return;
  phase_at_hand->work.flops += all - petsc_flops;
  petsc_flops = all;
}

/// Null without the profiling library. By dlsym, as mold resolves weak undefined symbols at link time.
const auto get_mpi_counts = reinterpret_cast<decltype(&carillon_get_mpi_counts)>(dlsym(RTLD_DEFAULT, "carillon_get_mpi_counts"));

double cpu_booked_s = 0;
double wall_booked_s = base::get_steady_s();

void book_time() {
  const double cpu_s = base::get_process_cpu_s();
  const double wall_s = base::get_steady_s();
  phase_at_hand->effort.cpu_seconds += cpu_s - cpu_booked_s;
  phase_at_hand->effort.wall_seconds += wall_s - wall_booked_s;
  cpu_booked_s = cpu_s;
  wall_booked_s = wall_s;
}

CarillonMpiCounts counts_booked{};

void book_messages() {
  if (!is_profiled()) return;
  CarillonMpiCounts now{};
  get_mpi_counts(&now);
  Work& work = phase_at_hand->work;
  work.messages += now.messages - counts_booked.messages;
  work.bytes += now.bytes - counts_booked.bytes;
  work.collectives += now.collectives - counts_booked.collectives;
  work.collective_bytes += now.collective_bytes - counts_booked.collective_bytes;
  phase_at_hand->effort.mpi_seconds += now.seconds - counts_booked.seconds;
  counts_booked = now;
}

/// Assigns everything since the last call to the current phase.
void book() {
  book_petsc_flops();
  book_messages();
  book_time();
}

}  // namespace

bool is_profiled() { return get_mpi_counts != nullptr; }

WorkPhase set_work_phase(WorkPhase phase) {
  book();
  const auto before = static_cast<WorkPhase>(phase_at_hand - totals.data());
  phase_at_hand = totals.data() + static_cast<std::size_t>(phase);
  return before;
}

void add_flops(double flops) { phase_at_hand->work.flops += flops; }

WorkTable find_work() {
  book();
  return totals;
}

WorkTable sum_work(const comm::Communicator& comm) {
  WorkTable sums = find_work();
  comm.sum(comm::list_numbers(sums));
  return sums;
}

}  // namespace carillon::petsc
