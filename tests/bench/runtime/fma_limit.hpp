// Peak rate of this processor: multiply-adds of floats per second of CPU time, measured.
#pragma once

#include "runtime/synth/kernels.hpp"

namespace carillon::bench {

/// FMA lanes per second of CPU time with the vectors of `isa`, from 24 (AVX-512) or 12 independent chains in registers; for SSE2, which has
/// no FMA, a multiplication and an addition count as one. Runs for about `seconds`.
double measure_fma_lanes_per_s(synth::Isa isa, double seconds);

}  // namespace carillon::bench
