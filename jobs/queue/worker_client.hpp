// Attempts on one rank in forks of a process that has MPI, PETSc and SLEPc: their starts cost more than a small job.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "runtime/base/descriptor.hpp"

namespace carillon::queue {

/// The worker (jobs/queue/worker) of this process. It is started by the first attempt, and again when it has ended: it ends with this
/// process and when it was idle for a while.
class WorkerClient {
 public:
  /// Starts the attempt with these words (attempt::make_arguments()) as a child of this process, in its own session, with its output in
  /// `log`. nullopt: no worker; the caller starts the program.
  std::optional<pid_t> start(const std::filesystem::path& log, const std::vector<std::string>& words);

 private:
  bool make_worker();
  std::optional<pid_t> ask(const std::string& message);

  base::Descriptor socket_;
  pid_t worker_ = 0;
  bool is_first_ = true;
  bool is_unusable_ = false;  // does not start
};

}  // namespace carillon::queue
