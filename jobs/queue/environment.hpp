// What the queue sees of the world: three small interfaces. Its decisions (settle.hpp, runner.hpp) use nothing else but rows, so that tests
// choose the order of events and the time. local.hpp has the real ones.
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

/// The folders of the jobs in the store.
class Disk {
 public:
  virtual ~Disk() = default;
  /// Whether a quick look finds a whole bank.
  virtual bool has_bank(const store::Id& id) const = 0;
  /// Whether an attempt holds the lock of the folder of work.
  virtual bool is_locked(const store::Id& id) const = 0;
  /// attempt.json and outcome.json; none when there is none, or none that can be read.
  virtual std::optional<outcome::Attempt> read_attempt(const store::Id& id) const = 0;
  virtual std::optional<outcome::Outcome> read_outcome(const store::Id& id) const = 0;
  virtual void remove_work(const store::Id& id) = 0;
  /// Whether hardly a byte is free, or `error` (may be null) says so.
  virtual bool is_full(const std::exception* error) const = 0;
};

/// Time since boot, which no change of the wall clock moves. It never goes backwards within a boot.
class Clock {
 public:
  virtual ~Clock() = default;
  /// Seconds since the boot of that id. No decision rests on a wall clock.
  virtual double get_boot_s() const = 0;
  virtual std::string get_boot_id() const = 0;
  /// Waits until a child ends, a signal comes or the time is over. SIGTERM, SIGINT or SIGHUP when that came, else 0.
  virtual int wait(double seconds) = 0;
};

/// A child that has ended.
struct EndedChild {
  pid_t pid = 0;
  int exit_code = 0;  // 128 + signal when a signal ended it
};

/// How an attempt is started, in addition to what its row says.
struct StartOptions {
  double time_limit_s = 0.0;   // 0: none
  bool is_prediction = false;  // find out what the job needs, and solve nothing
  int signal_at_end = 0;       // sent to it when the thread that started it ends; 0: it outlives this process
};

/// The processes of this machine.
class Launcher {
 public:
  virtual ~Launcher() = default;
  /// Starts an attempt with the token, ranks and memory of the row. SystemError when it cannot be started.
  virtual pid_t start(const registry::Job& job, const StartOptions& options) = 0;
  /// A child that has ended and was not reported yet.
  virtual std::optional<EndedChild> reap_child() = 0;
  virtual bool send_signal(pid_t pid, int signal) = 0;
  /// A process by its number, this one for 0; none when there is none.
  virtual std::optional<process::Identity> find_process(pid_t pid) const = 0;
  virtual process::Life find_life(const process::Identity& identity) const = 0;
  /// Whether a process that lives is the attempt of this row: it was started with the row's token. attempt.json, which every member of a
  /// group may write, can name another process, and that must get no signal.
  virtual bool is_attempt_of(const registry::Job& job, const process::Identity& found) const = 0;
  /// Whether the queue that started an attempt is gone.
  virtual bool is_orphan(pid_t attempt) const = 0;
  /// Memory that a process and all below it hold [GB].
  virtual double find_used_gb(pid_t pid) const = 0;
  virtual base::Host find_host() const = 0;
};

struct Environment {
  Disk& disk;
  Clock& clock;
  Launcher& launcher;
};

}  // namespace carillon::queue
