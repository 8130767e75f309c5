// Counters of the profiling library (precompute/petsc/profile) and their accessor.
#pragma once

/// For this process since MPI started.
struct CarillonMpiCounts {
  double messages;          // point-to-point sends
  double bytes;             // bytes of those
  double collectives;       // collective calls
  double collective_bytes;  // bytes contributed by this rank
  double seconds;           // wall time inside MPI: transfers and waiting
};

extern "C" {
/// Defined by the profiling library only: looked up at run time.
void carillon_get_mpi_counts(CarillonMpiCounts* counts);
}
