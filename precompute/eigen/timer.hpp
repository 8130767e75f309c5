// Seconds of the solver stages.
#pragma once

#include <mpi.h>

namespace carillon::eigen {

/// Adds its lifetime to a sum.
class Timer {
 public:
  explicit Timer(double& sum_s) : sum_s_(sum_s), start_s_(MPI_Wtime()) {}
  ~Timer() { sum_s_ += MPI_Wtime() - start_s_; }
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

 private:
  double& sum_s_;
  double start_s_;
};

}  // namespace carillon::eigen
