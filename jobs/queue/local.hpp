// The environment of the queue on this machine.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "jobs/queue/environment.hpp"
#include "jobs/queue/worker_client.hpp"
#include "jobs/store/store.hpp"

namespace carillon::queue {

/// Folders of a store, read at each call.
class LocalDisk final : public Disk {
 public:
  explicit LocalDisk(const store::Store& store) : store_(store) {}
  bool has_bank(const store::Id& id) const override { return store_.has_bank(id); }
  bool is_locked(const store::Id& id) const override;
  std::optional<outcome::Attempt> read_attempt(const store::Id& id) const override;
  std::optional<outcome::Outcome> read_outcome(const store::Id& id) const override;
  void remove_work(const store::Id& id) override { store_.remove_work(id); }
  bool is_full(const std::exception* error) const override;

 private:
  const store::Store& store_;
};

/// CLOCK_BOOTTIME of this machine.
class LocalClock final : public Clock {
 public:
  double get_boot_s() const override;
  std::string get_boot_id() const override;
  /// SIGTERM, SIGINT and SIGHUP must be blocked.
  int wait(double seconds) override;
};

/// Command line options of attempts.
struct AttemptCommand {
  std::filesystem::path program;            // carillon
  bool has_pictures = false;                // draw the first modes for the report of each bank
  std::vector<std::string> mpirun_options;  // arguments of mpirun
};

/// Starts attempts as children of this process, each in its own session; those of carillon-precompute on one rank by a worker.
class LocalLauncher final : public Launcher {
 public:
  LocalLauncher(const store::Store& store, AttemptCommand command) : store_(store), command_(std::move(command)) {}
  pid_t start(const registry::Job& job, const StartOptions& options) override;
  std::optional<EndedChild> reap_child() override;
  bool send_signal(pid_t pid, int signal) override;
  std::optional<process::Identity> find_process(pid_t pid) const override;
  process::Life find_life(const process::Identity& identity) const override { return process::find_life(identity); }
  bool is_attempt_of(const registry::Job& job, const process::Identity& found) const override;
  bool is_orphan(pid_t attempt) const override;
  double find_used_gb(pid_t pid) const override;
  base::Host find_host() const override { return base::find_host(); }

 private:
  const store::Store& store_;
  const AttemptCommand command_;
  WorkerClient worker_;
};

/// Disk, clock and launcher.
class LocalEnvironment {
 public:
  explicit LocalEnvironment(const store::Store& store, AttemptCommand command = {}) : disk_(store), launcher_(store, std::move(command)) {}
  operator Environment() { return {disk_, clock_, launcher_}; }

 private:
  LocalDisk disk_;
  LocalClock clock_;
  LocalLauncher launcher_;
};

}  // namespace carillon::queue
