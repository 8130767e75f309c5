// How an attempt at a job ended (outcome.json), and what follows from it. Written by the process of the attempt, wherever it ran; read by
// whoever keeps the registry.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "runtime/config/error.hpp"

namespace carillon::outcome {

enum class Cause {
  none,          // the bank is in the store
  input,         // the job or its mesh cannot be used (exit code 2)
  solve,         // the numerics found no solution (3)
  memory,        // not enough memory: said by the program (4), or it was killed for it
  disk_full,     // no room on a disk (4)
  system,        // the machine refused something else (4)
  checkpointed,  // saved and stopped, asked to by somebody else than us (85)
  stopped,       // saved or not, because we were asked to stop
  time_limit,    // saved or not, because the time of the job was over
  killed,        // by a signal that nobody here sent
  crashed,       // by a signal of its own making: SIGSEGV, SIGABRT ...
  node_lost,     // mpirun lost a machine or a rank
  hung,          // neither progress nor work for too long
  bad_bank,      // the program said that all is well, and the bank is not
  start,         // a program could not be started
};

struct Outcome {
  std::string attempt;  // its id
  Cause cause = Cause::killed;
  std::string reason;  // one true sentence without a full stop; empty for `none`
  int exit_code = 0;   // of the program, 128 + signal when a signal ended it
  int ranks = 1;
  double seconds = 0.0;         // of this attempt
  double peak_memory_gb = 0.0;  // of all its processes together, as looked at while it ran
  double memory_need_gb = 0.0;  // cause `memory`: what the program said that it needs; 0: nothing said
  double percent = 0.0;         // how far it came, 0 to 100
  bool is_further = false;      // further than any attempt before, and that is saved in its checkpoint
  std::string host;
  std::string started;  // UTC, for people
  std::string ended;
};

/// The word of a cause in outcome.json ("disk_full"), and back; none for a word that is not known.
std::string to_text(Cause cause);
std::optional<Cause> find_cause(const std::string& word);

/// STORE/work/ID/outcome.json, written whole and last. SystemError when the disk refuses.
void write_outcome(const std::filesystem::path& work, const Outcome& outcome);
/// None when there is none, or none that can be read.
std::optional<Outcome> read_outcome(const std::filesystem::path& work);

/// What is assumed of an attempt that is gone without an outcome.
Outcome make_killed();

enum class Next { done, failed, queue, wait };
struct Decision {
  Next next = Next::failed;
  double delay_s = 0.0;    // wait: at least this long, in boot time
  int failures = 0;        // the new count
  double memory_gb = 0.0;  // ask for at least this much from now on; 0: as before
  std::string reason;      // for status; empty for `done`
};

inline constexpr int kMostRetries = 3;

/// What follows from an outcome after `failures` counted ones (0 at first, and again after progress). docs/howto/jobs.md has the table.
Decision decide(const Outcome& outcome, int failures);

}  // namespace carillon::outcome
