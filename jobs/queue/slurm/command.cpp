#include "jobs/queue/slurm/command.hpp"

#include <cerrno>

namespace carillon::slurm {

Finished run_command(const std::vector<std::string>& words, std::string_view input, double patience_s, std::size_t max_bytes) {
  try {
    return base::run({.words = words, .output = base::kCapture, .errors = base::kCapture},
                     {.input = input, .patience_s = patience_s, .max_bytes = max_bytes});
  } catch (const base::StartError& error) {
    if (error.get_error() != ENOENT) throw;
    Finished finished;
    finished.exit_code = 127;
    finished.errors = error.what();
    return finished;
  }
}

}  // namespace carillon::slurm
