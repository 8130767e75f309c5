// Rank of this test process and number of ranks.
#pragma once

#include <mpi.h>

namespace carillon::tests {

inline int get_rank() {
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  return rank;
}

inline int get_ranks() {
  int ranks = 1;
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  return ranks;
}

}  // namespace carillon::tests
