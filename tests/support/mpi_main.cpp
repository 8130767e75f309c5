// main() of the test programs run by mpirun: initialises and finalises MPI, PETSc and SLEPc once; a failure on any rank fails the run.
#include <gtest/gtest.h>
#include <mpi.h>

#include "precompute/petsc/session.hpp"
#include "tests/support/choose_sources.hpp"

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (!carillon::tests::choose_sources(argc, argv)) return 2;
  carillon::petsc::Session session(argc, argv);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank != 0) {
    auto& listeners = testing::UnitTest::GetInstance()->listeners();
    delete listeners.Release(listeners.default_result_printer());
  }
  int failed = RUN_ALL_TESTS();
  int any = 0;
  MPI_Allreduce(&failed, &any, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  return any;
}
