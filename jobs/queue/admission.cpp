// Method:     Free memory: the smaller of (a) memory not admitted to running jobs, and (b) available memory minus memory that running jobs
//             were admitted but do not hold yet. Backfilling with a reservation for the first job (EASY), with a fixed patience instead of
//             run time estimates. docs/howto/jobs.md
// Source:     Lifka 1995 (EASY).
#include "jobs/queue/admission.hpp"

#include <algorithm>
#include <cmath>

namespace carillon::queue {
namespace {

constexpr double kUnknownGb = 0.5;  // without a prediction

struct Room {
  int cores = 0;
  double memory_gb = 0.0;
};

Room calc_room(const Host& host, const std::vector<Admitted>& running) {
  Room room{host.cores, kMemoryShare * host.total_gb};
  double available_gb = host.available_gb - (1.0 - kMemoryShare) * host.total_gb;
  for (const Admitted& job : running) {
    room.cores -= job.ranks;
    room.memory_gb -= job.memory_gb;
    available_gb -= std::max(0.0, job.memory_gb - job.used_gb);
  }
  room.memory_gb = std::min(room.memory_gb, available_gb);
  return room;
}

/// True if it fits as soon as all running jobs have ended.
bool will_fit(const Host& host, const std::vector<Admitted>& running, double memory_gb) {
  double free_gb = host.available_gb - (1.0 - kMemoryShare) * host.total_gb;
  for (const Admitted& job : running) free_gb += job.used_gb;
  return memory_gb <= free_gb;
}

int choose_ranks(const Host& host, const Need& need, std::size_t competitors) {
  if (need.ranks > 0) return std::min(need.ranks, host.cores);
  if (need.seconds < kSmallSeconds) return 1;
  const double one_gb = std::max(calc_memory(need, 1), 1e-3);
  const double by_memory = std::max(1.0, std::floor(kMemoryShare * host.total_gb / one_gb));
  const double side_by_side = std::min({static_cast<double>(competitors), static_cast<double>(host.cores), by_memory});
  const double worth = std::max(1.0, std::floor(need.seconds / kSecondsPerRank));
  return static_cast<int>(std::min(worth, std::floor(host.cores / std::max(1.0, side_by_side))));
}

}  // namespace

double calc_memory(const Need& need, int ranks) {
  if (need.memory_gb > 0.0) return need.memory_gb;
  if (need.predicted_gb.empty()) return std::max(kUnknownGb, need.min_gb);
  // Between two predictions the larger one; beyond the last prediction the last.
  const std::size_t place = std::max(0.0, std::log2(std::max(1, ranks)));
  const std::size_t last = need.predicted_gb.size() - 1;
  const bool is_power = (ranks & (ranks - 1)) == 0;
  const double predicted_gb =
      std::max(need.predicted_gb[std::min(place, last)], need.predicted_gb[std::min(place + (is_power ? 0 : 1), last)]);
  return std::max(predicted_gb, need.min_gb);
}

std::vector<Admission> choose(const Host& host, const std::vector<Admitted>& running, const std::vector<Candidate>& candidates) {
  Room room = calc_room(host, running);
  std::vector<Admitted> all = running;
  std::vector<Admission> admissions;
  bool is_kept = false;  // the rest is reserved for a job that has waited long enough
  for (const Candidate& candidate : candidates) {
    Admission admission;
    admission.ranks = choose_ranks(host, candidate.need, running.size() + candidates.size());
    admission.memory_gb = calc_memory(candidate.need, admission.ranks);
    if (admission.memory_gb > kMemoryShare * host.total_gb) {
      admission.decision = Admission::Decision::never;
    } else if (!is_kept && admission.ranks <= room.cores && admission.memory_gb <= room.memory_gb) {
      admission.decision = Admission::Decision::start;
      room.cores -= admission.ranks;
      room.memory_gb -= admission.memory_gb;
      all.push_back({admission.ranks, admission.memory_gb, 0.0});
    } else if (candidate.blocked_s > kPatienceSeconds && will_fit(host, all, admission.memory_gb)) {
      is_kept = true;
    }
    admissions.push_back(admission);
  }
  return admissions;
}

}  // namespace carillon::queue
