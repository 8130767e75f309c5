// Reading of the job of a run.
#pragma once

#include <filesystem>

#include "precompute/run/run.hpp"

namespace carillon::run {

/// Reads the job on rank 0 into run.job on every rank and checks everything that needs no mesh: solver options, and that outputs can be
/// written. Collective. Throws InputError on every rank.
void open_job(Run& run, const std::filesystem::path& file, job::BankKey bank = job::BankKey::required);

}  // namespace carillon::run
