// Programs that answer within seconds (squeue, sbatch ...).
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "runtime/base/command.hpp"

namespace carillon::slurm {

using base::Finished;

/// What a program may print on each of its outputs: squeue's lines of a million jobs.
inline constexpr std::size_t kMaxOutputBytes = 128 << 20;

/// Runs words[0] (by PATH) with `input`, and waits at most `patience_s`, and some seconds more for a program that was killed. Never throws
/// for what the program does, nor where there is none: then its exit code is 127. SystemError when this process has no pipes or processes
/// left. The program ends with this process.
Finished run_command(const std::vector<std::string>& words, std::string_view input = {}, double patience_s = 60.0,
                     std::size_t max_bytes = kMaxOutputBytes);

}  // namespace carillon::slurm
