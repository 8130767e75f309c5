// What a run found, as a bank.
#pragma once

#include "precompute/run/solve_body.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::run {

/// Makes the bank without its provenance; takes the surface out of `body` and the steps out of `surface_modes`. Rank 0 only.
bank::Bank make_bank(const job::JobSpec& job, const Setting& setting, Body& body, const SolvedBody& solved,
                     io::SurfaceModes& surface_modes);

}  // namespace carillon::run
