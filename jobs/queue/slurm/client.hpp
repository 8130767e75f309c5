// Slurm's commands: sbatch, squeue, scontrol, scancel, and sacct if there is accounting.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "jobs/queue/slurm/packing.hpp"
#include "jobs/queue/slurm/script.hpp"
#include "jobs/queue/slurm_settings.hpp"
#include "runtime/base/error.hpp"

namespace carillon::slurm {

/// Slurm does not answer. No job changes its state.
class Unreachable : public SystemError {
  using SystemError::SystemError;
};

enum class SlurmPhase { waits, runs, ended };

/// A job or a task of an array.
struct SlurmStatus {
  SlurmPhase phase = SlurmPhase::waits;
  std::string state;   // "PENDING", "NODE_FAIL"
  std::string reason;  // "Resources", "TimeLimit"; "None": none
  int exit_code = 0;   // after the end, if known
  int signal = 0;      // that ended the job
  int restarts = 0;
};

/// Runs Slurm's commands and parses their output. Keeps no state of jobs. Throws Unreachable if Slurm does not answer, SystemError if Slurm
/// refuses.
class SlurmClient {
 public:
  explicit SlurmClient(queue::SlurmSettings settings) : settings_(std::move(settings)) {}
  const queue::SlurmSettings& settings() const { return settings_; }

  /// Submits a batch; returns the number of the job. Unreachable; SystemError "Slurm refuses ...: reason".
  std::string submit(const Batch& batch) const;

  /// Status from squeue of the arrays of these jobs ("123", "123_4"), by job. Without jobs that Slurm has forgotten.
  std::map<std::string, SlurmStatus> list(const std::vector<std::string>& jobs) const;

  /// Details of an ended job (scontrol, else sacct); none if Slurm has forgotten it.
  std::optional<SlurmStatus> find_end(const std::string& job) const;

  /// The number of the job with this name that was submitted as `batch`, if Slurm knows it.
  std::optional<std::string> find_by_title(const std::string& title, const std::string& batch) const;

  /// Cancels jobs; ended ones are no error.
  void cancel(const std::vector<std::string>& jobs) const;

  /// Inside a job: true if its state is RUNNING (Slurm is not ending it); requeues it, not before `delay_s`.
  bool is_running(const std::string& job) const;
  void requeue(const std::string& job, double delay_s) const;

  /// The largest group of equal nodes that are up in the partition, by total cores; none if sinfo lists none.
  std::optional<Machine> find_machine() const;

  /// Maximum number of tasks of an array.
  int find_max_tasks() const;

 private:
  queue::SlurmSettings settings_;
};

/// "123_4" and "123_4.7" -> "123".
std::string find_array(const std::string& job);
/// "123_4.7" -> "123_4": the task of job 7.
std::string find_task(const std::string& job);
bool is_packed(const std::string& job);

// Parsers, exposed for tests.
SlurmPhase find_phase(std::string_view state);
/// Lines of squeue --format=%i|%T|%r.
std::map<std::string, SlurmStatus> parse_list(std::string_view text);
/// Lines of sinfo --Node --format=%N|%P|%X|%Y|%m|%T; empty partition: Slurm's default.
std::optional<Machine> parse_nodes(std::string_view text, std::string_view partition);
/// One line of scontrol --oneliner show job.
std::optional<SlurmStatus> parse_show(std::string_view line);

}  // namespace carillon::slurm
