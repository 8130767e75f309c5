// Programs that answer within seconds (squeue, sbatch ...), run without a shell.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace carillon::slurm {

struct Finished {
  int exit_code = 0;      // 128 + signal when a signal ended it, 127 when it could not be started
  bool was_slow = false;  // had not ended in time, and was killed
  bool was_long = false;  // printed more than anybody can want to know, and was killed
  std::string output, errors;
};

/// What a program may print on each of its outputs: squeue's lines of a million jobs.
inline constexpr std::size_t kMostOutputBytes = 128 << 20;

/// Runs words[0] (by PATH) with `input`, and waits at most `patience_s`, and some seconds more for a program that was killed. Never throws
/// for what the program does; SystemError when this process has no pipes or processes left. The program ends with this process.
Finished run_command(const std::vector<std::string>& words, std::string_view input = {}, double patience_s = 60.0,
                     std::size_t most_bytes = kMostOutputBytes);

}  // namespace carillon::slurm
