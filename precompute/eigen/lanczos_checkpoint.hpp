// How a block Lanczos iteration is saved between two steps, and resumed.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "precompute/eigen/checkpoint.hpp"

namespace carillon::eigen {

/// Where an iteration is between two steps, without its basis. The same on every rank.
struct LanczosState {
  /// block, room, size, width, previous, next_check, last_size, last_converged, steps, random columns so far.
  std::array<std::int64_t, 10> sizes{};
  std::vector<double> t;  // (size, size) the projected operator

  std::int64_t size() const { return sizes[2]; }
};

/// What saves an iteration, and what it resumes from.
struct LanczosCheckpoint {
  std::function<CheckpointRequest()> ask;                               // local, every step
  std::function<void(const LanczosState&, const Columns& basis)> save;  // collective
  const LanczosState* start = nullptr;                                  // null: from the beginning
  std::function<void(const Columns& basis)> read;                       // of start; collective
  std::function<void(const std::string& why)> reject;                   // start does not fit; collective
  bool was_stopped = false;                                             // it ended on request, after save()
};

}  // namespace carillon::eigen
