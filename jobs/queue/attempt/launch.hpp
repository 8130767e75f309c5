// How the solver is started.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include "jobs/queue/attempt/attempt.hpp"

namespace carillon::attempt {

struct Launch {
  std::vector<std::string> arguments;    // the first is the absolute path of the program
  std::vector<std::string> environment;  // "NAME=value"
};

/// Folders for the temporary files of one attempt, with its token in their names, so that the next attempt can remove them.
class Scratch {
 public:
  explicit Scratch(const std::string& token);
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  const std::filesystem::path& temporary() const { return temporary_; }
  const std::filesystem::path& shared_memory() const { return shared_memory_; }  // empty: none

  /// Removes what an attempt with this token left.
  static void remove_left(const std::string& token);

 private:
  std::filesystem::path temporary_, shared_memory_;
};

/// Whether a batch system gave us the machine.
bool is_under_slurm();

/// The command and the environment. `scratch` may be null (under Slurm). SystemError when a program is not installed.
Launch make_launch(const Options& options, const std::string& token, const Scratch* scratch);

/// Starts it in `folder`, in a process group of its own, with output appended to `log` and no input. The kernel sends it SIGTERM when this
/// process dies. SystemError when it cannot be started.
pid_t start(const Launch& launch, const std::filesystem::path& folder, const std::filesystem::path& log,
            const std::filesystem::path& output = {});

}  // namespace carillon::attempt
