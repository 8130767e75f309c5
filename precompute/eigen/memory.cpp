#include "precompute/eigen/memory.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string>

#include "precompute/petsc/session.hpp"
#include "runtime/base/failure.hpp"
#include "runtime/base/host.hpp"

namespace carillon::eigen {
namespace {

/// Available on the machine and in its control groups [byte].
std::int64_t find_host_left() { return static_cast<std::int64_t>(1e9 * base::find_host().available_gb); }

double to_gb(std::int64_t bytes) { return static_cast<double>(bytes) / 1e9; }

}  // namespace

std::int64_t find_memory_left() { return std::min(find_host_left(), base::find_address_space_left()); }

void check_memory(const comm::Communicator& comm, std::int64_t need_bytes, std::int64_t limit_bytes, const std::string& what) {
  MPI_Comm own_host = MPI_COMM_NULL;
  MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &own_host);
  const comm::Communicator host(own_host);
  std::array<std::int64_t, 2> together{need_bytes, base::find_memory().resident};
  host.sum(together);
  const std::int64_t left = host.min(find_host_left());
  const std::int64_t total = together[0] + together[1];
  MPI_Comm_free(&own_host);
  const std::int64_t own_left = base::find_address_space_left();
  const std::int64_t everywhere = comm.sum(need_bytes);
  comm.agree([&] {
    constexpr const char* kRemedy = "Take a coarser mesh, a narrower band or fewer modes, or more ranks on more machines.";
    if (need_bytes > own_left) {
      throw MemoryError(fmt::format("{} needs about {:.2f} GB on one rank ({:.2f} GB on all), and this process may allocate {:.2f} GB more "
                                    "(ulimit -v). {}",
                                    what, to_gb(need_bytes), to_gb(everywhere), to_gb(own_left), kRemedy),
                        static_cast<double>(together[0]));
    }
    if (limit_bytes > 0 && total > limit_bytes)
      throw MemoryError(fmt::format("{} needs about {:.2f} GB in addition to {:.2f} GB in use, and the limit (--memory-gb) is "
                                    "{:.2f} GB. {}",
                                    what, to_gb(together[0]), to_gb(together[1]), to_gb(limit_bytes), kRemedy),
                        static_cast<double>(total));
    if (together[0] > left) {
      std::array<char, 256> name{};
      gethostname(name.data(), name.size() - 1);
      throw MemoryError(
          fmt::format("{} needs about {:.2f} GB on {} ({} ranks; {:.2f} GB on all machines), and {:.2f} GB are left there. {}", what,
                      to_gb(together[0]), name.data(), host.size(), to_gb(everywhere), to_gb(left), kRemedy),
          static_cast<double>(together[0]));
    }
  });
}

}  // namespace carillon::eigen
