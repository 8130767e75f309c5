// The job of a run.
#pragma once

#include <filesystem>

#include "precompute/run/run.hpp"

namespace carillon::run {

/// Reads the job on rank 0 into run.job on every rank, and checks what needs no mesh: the solver's options, and that the outputs can be
/// written where there are to be any. Collective. Throws InputError on every rank.
void open_job(Run& run, const std::filesystem::path& file, job::BankKey bank = job::BankKey::required);

}  // namespace carillon::run
