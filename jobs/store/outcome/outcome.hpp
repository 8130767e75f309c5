// How an attempt at a job ended (outcome.json) and who works on it (attempt.json): two small files in the folder of the work, written by
// the process of the attempt, wherever it runs; read by the program that keeps the registry.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "jobs/store/process/process.hpp"

namespace carillon::outcome {

enum class Cause {
  done,          // the bank is in the store
  bad_input,     // the job or its mesh cannot be used (exit code 2)
  no_solution,   // the numerics found none (3)
  memory_limit,  // above the job's "memory_gb"
  memory,        // not enough: said by the program (4), or it was killed for it
  disk_full,     // no room on a disk
  system,        // the machine refused something else (4)
  checkpointed,  // saved and stopped (85), on a request that was not ours
  stopped,       // we were asked to stop, saved or not
  time_limit,    // the time of the job was over, saved or not
  killed,        // by a signal from elsewhere
  crashed,       // by a signal of its own making: SIGSEGV, SIGABRT ...
  node_lost,     // mpirun lost a machine or a rank
  hung,          // neither progress nor work for too long
  bad_bank,      // the program said that all is well, and the bank is not
  no_program,    // what has to be started is not here
  predicted,     // nothing was solved: what it needs is known now
};
/// The word of a cause in outcome.json ("disk-full"), and back; none for a word that is not known.
std::string to_text(Cause cause);
std::optional<Cause> find_cause(std::string_view word);

/// The process that works on a job, written by it before it starts anything. Stays when it dies.
struct Attempt {
  std::string token;  // 32 hex digits; everything it starts has CARILLON_ATTEMPT=<token> in its environment
  process::Identity process;
  int ranks = 1;
  double memory_gb = 0.0;  // admitted; 0: not known
  std::string started;     // UTC, for people
};

struct Outcome {
  std::string token;  // of the attempt
  Cause cause = Cause::killed;
  std::string reason;  // one true sentence without a full stop; empty when done
  int exit_code = 0;   // of the solver or mpirun; 128 + signal when a signal ended it
  int ranks = 1;
  double seconds = 0.0;         // of this attempt
  double peak_memory_gb = 0.0;  // of all its processes together, as looked at while it ran
  double memory_need_gb = 0.0;  // cause memory: what the program said that it needs; 0: it did not say
  double percent = 0.0;         // how far it came, 0 to 100
  bool is_further = false;      // further than any attempt before, and that is saved in its checkpoint
  std::string host;
  std::string started, ended;  // UTC, for people
};

/// WORK/outcome.json and WORK/attempt.json, written whole. SystemError when the disk refuses.
void write_outcome(const std::filesystem::path& work, const Outcome& outcome);
void write_attempt(const std::filesystem::path& work, const Attempt& attempt);
/// None when there is none, or none that can be read.
std::optional<Outcome> read_outcome(const std::filesystem::path& work);
std::optional<Attempt> read_attempt(const std::filesystem::path& work);

/// What is assumed of an attempt that is gone without an outcome.
Outcome make_killed(const std::string& token);

/// This moment as "2026-11-20T20:22:30Z", for people.
std::string find_utc();

}  // namespace carillon::outcome
