#include "precompute/run/end_in_error.hpp"

#include <fmt/core.h>

#include <chrono>
#include <cstdio>
#include <thread>

#include "runtime/base/message.hpp"

namespace carillon::run {

int end_in_error(MPI_Comm comm, const std::string& program, const std::string& file, const base::Result& result) {
  std::fflush(stdout);
  int rank = 0, all_here = 0;
  MPI_Comm_rank(comm, &rank);
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Ibarrier(comm, &request);
  for (int wait_ms = 0; wait_ms < 5000 && all_here == 0; wait_ms += 10) {
    MPI_Test(&request, &all_here, MPI_STATUS_IGNORE);
    if (all_here == 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  if (rank == 0 || all_here == 0) {
    fmt::print(stderr, "{}: error: {}\n", program, base::show_message(result.message));
    if (!file.empty()) base::write_result(file, result);
  }
  std::fflush(stderr);
  const int code = base::get_exit_code(result.kind);
  if (all_here == 0) MPI_Abort(MPI_COMM_WORLD, code);
  return code;
}

}  // namespace carillon::run
