// All ranks of the test.
#pragma once

#include "precompute/comm/communicator.hpp"

namespace carillon::comm {

inline const Communicator& world() {
  static const Communicator comm(MPI_COMM_WORLD);
  return comm;
}

inline bool is_last() { return world().rank() == world().size() - 1; }

}  // namespace carillon::comm
