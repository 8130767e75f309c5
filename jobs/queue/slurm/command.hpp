// Runs short programs (squeue, sbatch ...).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/command.hpp"

namespace carillon::slurm {

using base::Finished;

/// Output limit: squeue lines of a million jobs.
inline constexpr std::size_t kMaxOutputBytes = 128 << 20;

/// Runs words[0] (from PATH) with `input`; kills it after `patience_s`. Exit code 127 if there is no such program. SystemError only if no
/// pipe or process can be created. The program ends with this process.
Finished run_command(const std::vector<std::string>& words, std::string_view input = {}, double patience_s = 60.0,
                     std::size_t max_bytes = kMaxOutputBytes);

}  // namespace carillon::slurm
