// The environment of the queue on this machine: folders of a store, the clock since boot, processes.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "jobs/queue/environment.hpp"
#include "jobs/store/store.hpp"

namespace carillon::queue {

/// Reads the folders of a store at each call, and keeps nothing.
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

/// CLOCK_BOOTTIME of this machine. Keeps nothing.
class LocalClock final : public Clock {
 public:
  double get_boot_s() const override;
  std::string get_boot_id() const override;
  /// Sees SIGTERM, SIGINT and SIGHUP where they are blocked.
  int wait(double seconds) override;
};

/// What attempts are started with.
struct AttemptCommand {
  std::filesystem::path program;            // carillon itself
  bool has_pictures = false;                // draw the first modes for the report of each bank when it is done
  std::vector<std::string> mpirun_options;  // words for mpirun: which hosts, by which network
};

/// Attempts are children of this process until reap_child() returns them; each has a session of its own.
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
};

/// The three together.
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
