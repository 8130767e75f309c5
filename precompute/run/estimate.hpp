// What a problem of a given size would cost, without a job.
#pragma once

#include <string>

namespace carillon::run {

/// size: {"element": "T10" (or "T4"), "nodes": N, "modes": M (of the band; left out: 200)}. Returns one JSON object on one line:
/// cpu_seconds and phase_seconds of one rank on the machine of the cost model's table, memory_bytes by ranks, factor (entries, flops),
/// factorisations, right_sides. Throws InputError for bad text. No MPI, no files.
std::string estimate_costs(const std::string& size);

}  // namespace carillon::run
