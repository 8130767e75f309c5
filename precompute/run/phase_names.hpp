// What the job and the eigensolver call the same things.
#pragma once

#include <string>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/job/job_spec.hpp"

namespace carillon::run {

eigen::Factorisation to_eigen(job::Factorisation factorisation);
eigen::Method to_eigen(job::Method method);

/// "factor": of the progress file.
std::string get_key(eigen::Phase phase);

/// "factorising K - sigma M", "24 of 228 modes": of the log.
std::string describe(const eigen::Progress& progress);

}  // namespace carillon::run
