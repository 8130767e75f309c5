// Strikes that differ as those of a hand.
#pragma once

#include <cstdint>
#include <functional>

#include "runtime/bank/bank.hpp"
#include "runtime/bank/nearest.hpp"
#include "runtime/events/events.hpp"

namespace carillon::synth {

/// Changes the energy, the place, the direction and the length of a strike on a body. `variation`, 0 to 1, says by how much; 0 leaves the
/// strike as it is, to the bit. The same `seed` (of the body) and number of the strike give the same change. The triangle of the strike
/// must be one of the bank; `find` gives the place of its surface that is nearest to a point. Not for an audio thread.
void vary_strike(const bank::Bank& bank, const std::function<bank::NearestPlace(const Vec3&)>& find, double variation, std::uint64_t seed,
                 std::uint64_t strike, events::Impulse& impulse);

}  // namespace carillon::synth
