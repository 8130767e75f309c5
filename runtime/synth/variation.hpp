// Random variation of strikes.
#pragma once

#include <cstdint>
#include <functional>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/nearest.hpp"
#include "runtime/events/events.hpp"

namespace carillon::synth {

/// Varies energy, place, direction and length of a strike on a body. `variation`: 0 (unchanged bits) to 1. Deterministic by `seed` (of the
/// body) and number of the strike. The triangle of the strike must exist in the bank; `find` returns the nearest place of its surface. Not
/// for an audio thread.
void vary_strike(const bank::Bank& bank, const std::function<bank::NearestPlace(const Vec3&)>& find, double variation, std::uint64_t seed,
                 std::uint64_t strike, events::Impulse& impulse);

}  // namespace carillon::synth
