// attempt.json (the process of an attempt) and outcome.json (how it ended): files in the folder of work, written by the attempt on any
// host, read by the queue.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "jobs/store/process/process.hpp"

namespace carillon::outcome {

enum class Cause {
  done,          // the bank is published
  bad_input,     // unusable job or mesh (exit code 2)
  no_solution,   // no numerical solution (3)
  memory_limit,  // above "memory_gb" of the job
  memory,        // out of memory: reported by the program (4), or killed
  disk_full,     // disk or quota full
  system,        // another system error (4)
  checkpointed,  // saved and stopped (85), not requested by Carillon
  stopped,       // stopped on request, saved or not
  time_limit,    // time limit reached, saved or not
  killed,        // by an external signal
  crashed,       // SIGSEGV, SIGABRT ...
  node_lost,     // mpirun lost a host or a rank
  hung,          // neither output nor CPU time for too long
  bad_bank,      // exit code 0, but the bank is invalid
  no_program,    // a program is not installed
  predicted,     // prediction only: time and memory are known now
};
/// Words of outcome.json ("disk-full"); none for an unknown word.
std::string to_text(Cause cause);
std::optional<Cause> find_cause(std::string_view word);

/// The process of an attempt; written before the solver starts, never removed.
struct Attempt {
  std::string token;  // 32 hex digits; its children have CARILLON_ATTEMPT=<token> in their environment
  process::Identity process;
  int ranks = 1;
  double memory_gb = 0.0;  // admitted; 0: unknown
  std::string started;     // UTC, for display
};

struct Outcome {
  std::string token;  // of the attempt
  Cause cause = Cause::killed;
  std::string reason;  // one sentence without a full stop; empty if done
  int exit_code = 0;   // of the solver or mpirun; 128 + signal when a signal ended it
  int ranks = 1;
  double seconds = 0.0;         // of this attempt
  double peak_memory_gb = 0.0;  // of all processes together, sampled
  double memory_need_gb = 0.0;  // cause memory: need reported by the program; 0: unknown
  double percent = 0.0;         // progress, 0 to 100
  bool is_further = false;      // its checkpoint is further than that of any attempt before
  std::string host;
  std::string started, ended;  // UTC, for display
};

/// Atomic replacement of WORK/outcome.json and WORK/attempt.json. SystemError when the disk refuses.
void write_outcome(const std::filesystem::path& work, const Outcome& outcome);
void write_attempt(const std::filesystem::path& work, const Attempt& attempt);
/// None if the file is missing or damaged.
std::optional<Outcome> read_outcome(const std::filesystem::path& work);
std::optional<Attempt> read_attempt(const std::filesystem::path& work);

/// The outcome of an attempt whose process is gone without outcome.json.
Outcome make_killed(const std::string& token);

/// The current time as "2026-11-20T20:22:30Z", for display.
std::string find_utc();

}  // namespace carillon::outcome
