// The record of a run as JSON: what was chosen, found and used.
#pragma once

#include <string>
#include <vector>

#include "precompute/run/solve_body.hpp"
#include "runtime/base/json.hpp"

namespace carillon::run {

/// What goes under "run" in the resolved job and in the provenance of the bank. Rank 0 only.
base::Json describe_run(const Run& run, const Setting& setting, const Body& body, const SolvedBody& solved, const Measured& measured);

/// Its part about the program alone: name, version, ranks, phases.
base::Json describe_program(const Run& run);

/// Materials by region: what they are, how they damp, and their volume.
base::Json describe_materials(const fem::Materials& materials, const std::vector<double>& volume_m3);

}  // namespace carillon::run
