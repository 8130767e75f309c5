// Distribution of elements over ranks by position, without any rank knowing all of them.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::mesh {

/// Part of each of this rank's elements, 0 <= part < ranks, by recursive inertial bisection; parts differ by at most one element. Each rank
/// has a contiguous range of elements starting at first_element. Collective.
std::vector<std::int32_t> bisect(const comm::Communicator& comm, const std::vector<Vec3>& centres_m, std::int64_t first_element);

}  // namespace carillon::mesh
