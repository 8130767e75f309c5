// Elements to ranks by their places in space, without any rank knowing all.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesh {

/// The part of each of this rank's elements, 0 <= part < ranks, by recursive inertial bisection: parts differ by one element at most. Ranks
/// bring runs of the elements: this one's begins at first_element. Collective.
std::vector<std::int32_t> bisect(const comm::Communicator& comm, const std::vector<Vec3>& centres_m, std::int64_t first_element);

}  // namespace carillon::mesh
