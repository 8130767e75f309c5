// The record of a run as JSON: choices, results and resources.
#pragma once

#include <vector>

#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/base/json.hpp"

namespace carillon::run {

/// "run" of the resolved job and of the bank's provenance. Rank 0 only.
base::Json describe_run(const Run& run, const Solution& found, const Measured& measured);

/// Its part about the program: name, version, ranks, phases.
base::Json describe_program(const Run& run);

/// Materials by region: constants, damping, volume.
base::Json describe_materials(const fem::Materials& materials, const std::vector<double>& volume_m3);

}  // namespace carillon::run
