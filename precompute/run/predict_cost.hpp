// Cost of a problem of a given size, without a job.
#pragma once

#include <string>

namespace carillon::run {

/// size: {"element": "T10" (or "T4"), "nodes": N, "modes": M (of the band; default 200)}. Returns one JSON object on one line:
/// cpu_seconds and phase_seconds of one rank on the reference machine of the cost model, memory_bytes by ranks, factor (entries, flops),
/// factorisations, right_sides. Throws InputError for invalid text. No MPI, no files.
std::string predict_cost(const std::string& size);

}  // namespace carillon::run
