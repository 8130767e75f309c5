// Slurm as its own commands report it: sbatch, squeue, scontrol, scancel, and sacct where there is accounting.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "jobs/queue/slurm/packing.hpp"
#include "jobs/queue/slurm/script.hpp"
#include "jobs/queue/slurm/settings.hpp"
#include "runtime/base/error.hpp"

namespace carillon::slurm {

/// Slurm does not answer just now. No job's fault, and no job changes its state for it.
class Unreachable : public SystemError {
  using SystemError::SystemError;
};

enum class SlurmPhase { waits, runs, ended };

/// A job or a task of an array.
struct SlurmStatus {
  SlurmPhase phase = SlurmPhase::waits;
  std::string state;   // Slurm's word: "PENDING", "NODE_FAIL"
  std::string reason;  // Slurm's: "Resources", "TimeLimit"; "None" when there is none
  int exit_code = 0;   // of an ended one, where Slurm knows it
  int signal = 0;      // that ended it
  int restarts = 0;
};

/// Runs Slurm's commands and parses their output. Keeps no state of jobs: every answer is of now. It throws Unreachable where Slurm does
/// not answer, and SystemError where Slurm refuses.
class SlurmClient {
 public:
  explicit SlurmClient(Settings settings) : settings_(std::move(settings)) {}
  const Settings& settings() const { return settings_; }

  /// Hands the batch over; returns the number of the job. Unreachable; SystemError "Slurm refuses ...: why" when it will never take it.
  std::string submit(const Batch& batch) const;

  /// What squeue knows of these jobs ("123", or "123_4"; asked for by their leading numbers), by the same names. Those that Slurm has
  /// forgotten are not in it.
  std::map<std::string, SlurmStatus> list(const std::vector<std::string>& jobs) const;

  /// The end of one job in detail (scontrol, else sacct); none when Slurm has forgotten it.
  std::optional<SlurmStatus> find_end(const std::string& job) const;

  /// The number of the job of that name that was handed over as `batch`, if Slurm knows one.
  std::optional<std::string> find_by_title(const std::string& title, const std::string& batch) const;

  /// Ends them; those that have ended already are no error.
  void cancel(const std::vector<std::string>& jobs) const;

  /// Inside a job: whether Slurm still means it to run (and does not end it at this moment); queue it again, not before `delay_s`.
  bool is_running(const std::string& job) const;
  void requeue(const std::string& job, double delay_s) const;

  /// The nodes that are alike and have the most cores together, of the partition, as far as they are up; none when sinfo names none.
  std::optional<Machine> find_machine() const;

  /// How many tasks an array may have.
  int find_max_tasks() const;

 private:
  Settings settings_;
};

/// "123_4" and "123_4.7" -> "123".
std::string find_array(const std::string& job);
/// "123_4.7" -> "123_4": the task that job 7 of it shares with others.
std::string find_task(const std::string& job);
bool is_packed(const std::string& job);

// The parsers, for tests.
SlurmPhase find_phase(std::string_view state);
/// Lines of squeue --format=%i|%T|%r.
std::map<std::string, SlurmStatus> parse_list(std::string_view text);
/// Lines of sinfo --Node --format=%N|%P|%X|%Y|%m|%T; empty partition: Slurm's default.
std::optional<Machine> parse_nodes(std::string_view text, std::string_view partition);
/// One line of scontrol --oneliner show job.
std::optional<SlurmStatus> parse_show(std::string_view line);

}  // namespace carillon::slurm
