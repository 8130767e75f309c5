// A clock for SynthesiserOptions::ticks that stands still while the processor does something else.
#pragma once

#include <cstdint>

namespace carillon::synth {

/// CPU time of the calling thread [ns], less what asking for it has cost: time between two calls is that of the work between them. Two
/// tenths of a microsecond a call: for measurements, not for every callback. [any-thread]
std::uint64_t get_cpu_ticks() noexcept;

/// What asking has cost the calling thread so far [ns].
std::uint64_t get_cpu_ticks_cost_ns() noexcept;

}  // namespace carillon::synth
