// Admission: which jobs start now, and on how many ranks. Pure functions.
//
// Ranks: as requested, at most the cores. Without a request a small job (under kSmallSeconds on one rank) gets one rank, a large job cores
// / n, where n is the number of jobs that can run concurrently: running plus ready jobs, limited by cores and by memory. Memory: as
// requested, or predicted for these ranks. Order: as submitted. Later jobs may overtake a job that does not fit for kPatienceSeconds; then
// cores and memory are reserved for it.
#pragma once

#include <vector>

#include "runtime/base/host.hpp"

namespace carillon::queue {

using base::Host;

inline constexpr double kSmallSeconds = 30.0;
inline constexpr double kSecondsPerRank = 10.0;  // minimum work per rank
inline constexpr double kPatienceSeconds = 60.0;
inline constexpr double kMemoryShare = 0.95;  // usable share of the machine's memory

/// Resources of a job.
struct Need {
  int ranks = 0;                          // requested; 0: chosen here
  double memory_gb = 0.0;                 // requested, or raised after an attempt ran out of memory; 0: as predicted
  double seconds = 0.0;                   // on one rank, predicted; 0: unknown, treated as small
  std::vector<double> predicted_gb = {};  // on 1, 2, 4, 8 ... ranks; empty: unknown
  double min_gb = 0.0;                    // minimum, e.g. for pictures after the solve
  double serial_seconds = 0.0;            // serial part of `seconds`
};

/// Memory of a job on `ranks` ranks [GB].
double calc_memory(const Need& need, int ranks);

struct Admitted {
  int ranks = 1;
  double memory_gb = 0.0;
  double used_gb = 0.0;  // currently held by its processes
};

struct Candidate {
  Need need;
  double blocked_s = 0.0;  // time since it first did not fit
};

/// Decision about a candidate. never: needs more memory than this machine has.
struct Admission {
  enum class Decision { start, wait, never };
  Decision decision = Decision::wait;
  int ranks = 1;           // start
  double memory_gb = 0.0;  // start and never
};

/// One result per candidate, in order.
std::vector<Admission> choose(const Host& host, const std::vector<Admitted>& running, const std::vector<Candidate>& candidates);

}  // namespace carillon::queue
