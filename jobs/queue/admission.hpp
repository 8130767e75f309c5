// Which jobs start now, on how many ranks. Pure: no clock, no disk, no registry.
//
// Ranks: what the job asks for, at most the cores. A job that does not ask and is small (under kSmallSeconds on one rank) gets one; a large
// one gets cores / n ranks, where n is how many jobs could run side by side: as many as run or are ready, at most the cores, and at most as
// many of its size as the memory holds. Memory: asked for, or predicted for these ranks.
// Order: as submitted. A job that does not fit now may be passed by later ones for kPatienceSeconds; then cores and memory are kept for it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "runtime/base/host.hpp"

namespace carillon::queue {

using base::Host;

inline constexpr double kSmallSeconds = 30.0;
inline constexpr double kSecondsPerRank = 10.0;  // no rank is worth its start for less
inline constexpr double kPatienceSeconds = 60.0;
inline constexpr double kMemoryShare = 0.95;  // of the machine's memory; the rest is for what is not ours

/// What a job takes.
struct Need {
  int ranks = 0;                          // asked for; 0: to be chosen
  double memory_gb = 0.0;                 // asked for, or more after an attempt that ran out of it; 0: as predicted
  double seconds = 0.0;                   // on one rank, predicted; 0: not known, and small
  std::vector<double> predicted_gb = {};  // on 1, 2, 4, 8 ... ranks; empty: not known
  double min_gb = 0.0;                    // whatever is predicted, so much is given: for what follows the solve
  double serial_seconds = 0.0;            // of `seconds`, what does not fall with ranks
};

/// Memory of a job on so many ranks [GB].
double calc_memory(const Need& need, int ranks);

struct Admitted {
  int ranks = 1;
  double memory_gb = 0.0;
  double used_gb = 0.0;  // of it, what its processes hold now
};

struct Candidate {
  Need need;
  double blocked_s = 0.0;  // for how long it would have been started but for room
};

/// What happens to a candidate now. never: no moment of this machine has the memory.
struct Admission {
  enum class Decision { start, wait, never };
  Decision decision = Decision::wait;
  int ranks = 1;           // start
  double memory_gb = 0.0;  // start and never
};

/// One for each candidate, in their order.
std::vector<Admission> choose(const Host& host, const std::vector<Admitted>& running, const std::vector<Candidate>& candidates);

}  // namespace carillon::queue
