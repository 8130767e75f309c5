// Start of the solver.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "jobs/queue/attempt/attempt.hpp"

namespace carillon::attempt {

struct Launch {
  std::vector<std::string> arguments;    // the first is the absolute path of the program
  std::vector<std::string> environment;  // "NAME=value"
};

/// Temporary folders of one attempt, named by its token so that the next attempt can remove them.
class Scratch {
 public:
  explicit Scratch(const std::string& token);
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  const std::filesystem::path& temporary() const { return temporary_; }
  const std::filesystem::path& shared_memory() const { return shared_memory_; }  // empty: none

  /// Removes the folders of an ended attempt.
  static void remove_left(const std::string& token);

 private:
  std::filesystem::path temporary_, shared_memory_;
};

/// True inside a job of Slurm.
bool is_under_slurm();

/// Command and environment. `scratch`: null under Slurm. SystemError if a program is not installed.
Launch make_launch(const Options& options, const std::string& token, const Scratch* scratch);

/// The worker (jobs/queue/worker): its last word is `title_bytes` of room for the command lines of its forks, and CARILLON_ATTEMPT in its
/// environment that for their tokens. SystemError if carillon-precompute is not installed.
Launch make_worker_launch(std::size_t title_bytes);

/// Starts the command in `folder`, in its own process group, without input; standard output goes to `output` (empty: appended to `log`),
/// errors to `log`. It gets SIGTERM when this process dies. `solver`: Options::solver, called in a fork instead. SystemError if it cannot
/// be started.
pid_t start(const Launch& launch, const std::filesystem::path& folder, const std::filesystem::path& log,
            const std::filesystem::path& output = {}, const std::function<int(const std::vector<std::string>&)>& solver = {});

}  // namespace carillon::attempt
