// Programs that answer within seconds (squeue, sbatch ...), run without a shell.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace carillon::slurm {

struct Finished {
  int exit_code = 0;      // 128 + signal when a signal ended it, 127 when it could not be started
  bool was_slow = false;  // had not ended in time, and was killed
  std::string output, errors;
};

/// Runs words[0] (by PATH) with `input`, and waits at most `patience_s`. Never throws for what the program does; SystemError when this
/// process has no pipes or processes left. The program ends with this process.
Finished run_command(const std::vector<std::string>& words, std::string_view input = {}, double patience_s = 60.0);

}  // namespace carillon::slurm
