// Save and resume of a block Lanczos iteration between two steps.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "precompute/eigen/checkpoint.hpp"

namespace carillon::eigen {

/// State of an iteration between two steps, without its basis. The same on all ranks.
struct LanczosState {
  /// block, room, size, width, previous, next_check, last_size, last_converged, steps, random columns so far.
  std::array<std::int64_t, 10> sizes{};
  std::vector<double> t;  // (size, size) the projected operator

  std::int64_t size() const { return sizes[2]; }
};

/// Hooks to save an iteration, and the state to resume from.
struct LanczosCheckpoint {
  std::function<CheckpointRequest()> ask;                               // local, every step
  std::function<void(const LanczosState&, const Columns& basis)> save;  // collective
  const LanczosState* start = nullptr;                                  // null: start from the beginning
  std::function<void(const Columns& basis)> read;                       // columns of the basis of start; collective
  std::function<void(const std::string& why)> reject;                   // start does not fit; collective
  bool was_stopped = false;                                             // stopped on request, after save()
};

}  // namespace carillon::eigen
