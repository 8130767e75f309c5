// What the profiling library (precompute/petsc/profile) counts, and how a program asks for it.
#pragma once

/// Of this process since MPI started.
struct CarillonMpiCounts {
  double messages;          // sent from this rank to another
  double bytes;             // in them
  double collectives;       // calls in which many ranks take part
  double collective_bytes;  // what this rank puts into them
  double seconds;           // of wall time inside MPI: transfers and waiting
};

extern "C" {
/// Defined by the profiling library alone: a program looks it up while it runs.
void carillon_get_mpi_counts(CarillonMpiCounts* counts);
}
