// The solution of a run as a bank.
#pragma once

#include "precompute/job/job_spec.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::run {

/// Makes the bank without its provenance; moves the surface out of `found.body` and the steps out of `surface_modes`. Rank 0 only.
bank::Bank make_bank(const job::JobSpec& job, Solution& found, io::SurfaceModes& surface_modes);

}  // namespace carillon::run
