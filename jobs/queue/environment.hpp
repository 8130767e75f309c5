// Interfaces of the queue to disk, clock and processes. settle.hpp and runner.hpp use only these and rows, so that tests control time and
// the order of events. Implementations: local.hpp.
#pragma once

#include <sys/types.h>

#include <exception>
#include <optional>
#include <string>

#include "jobs/store/outcome/outcome.hpp"
#include "jobs/store/process/process.hpp"
#include "jobs/store/registry/job_table.hpp"
#include "runtime/base/host.hpp"

namespace carillon::queue {

/// Folders of jobs in the store.
class Disk {
 public:
  virtual ~Disk() = default;
  /// True if a quick look finds a complete bank.
  virtual bool has_bank(const store::Id& id) const = 0;
  /// True if an attempt holds the lock of the folder of work.
  virtual bool is_locked(const store::Id& id) const = 0;
  /// attempt.json and outcome.json; none if missing or damaged.
  virtual std::optional<outcome::Attempt> read_attempt(const store::Id& id) const = 0;
  virtual std::optional<outcome::Outcome> read_outcome(const store::Id& id) const = 0;
  virtual void remove_work(const store::Id& id) = 0;
  /// True if the disk is full, or if `error` (may be null) says so.
  virtual bool is_full(const std::exception* error) const = 0;
};

/// Time since boot: monotonic, independent of the wall clock.
class Clock {
 public:
  virtual ~Clock() = default;
  /// Seconds since boot, and the id of that boot.
  virtual double get_boot_s() const = 0;
  virtual std::string get_boot_id() const = 0;
  /// Waits until a child ends, a signal arrives or the time is over. Returns SIGTERM, SIGINT, SIGHUP or 0.
  virtual int wait(double seconds) = 0;
};

/// An ended child.
struct EndedChild {
  pid_t pid = 0;
  int exit_code = 0;  // 128 + signal if ended by a signal
};

/// Options of an attempt in addition to its row.
struct StartOptions {
  double time_limit_s = 0.0;   // 0: none
  bool is_prediction = false;  // only predict time and memory
  bool is_simulation = false;  // of carillon-simulate
  int signal_at_end = 0;       // sent to it when the starting thread ends; 0: it outlives this process
};

/// The processes of this machine.
class Launcher {
 public:
  virtual ~Launcher() = default;
  /// Starts an attempt with the token, ranks and memory of the row. SystemError.
  virtual pid_t start(const registry::Job& job, const StartOptions& options) = 0;
  /// The next ended child.
  virtual std::optional<EndedChild> reap_child() = 0;
  virtual bool send_signal(pid_t pid, int signal) = 0;
  /// A process by its number, 0: this process; none if it does not exist.
  virtual std::optional<process::Identity> find_process(pid_t pid) const = 0;
  virtual process::Life find_life(const process::Identity& identity) const = 0;
  /// True if the live process `found` was started with the token of the row.
  virtual bool is_attempt_of(const registry::Job& job, const process::Identity& found) const = 0;
  /// True if the queue that started an attempt is gone.
  virtual bool is_orphan(pid_t attempt) const = 0;
  /// Memory of a process and its descendants [GB].
  virtual double find_used_gb(pid_t pid) const = 0;
  virtual base::Host find_host() const = 0;
};

struct Environment {
  Disk& disk;
  Clock& clock;
  Launcher& launcher;
};

}  // namespace carillon::queue
