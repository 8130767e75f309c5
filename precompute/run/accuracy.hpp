// Accuracy as an input: "accuracy_cents" in a job instead of element, mesh size and tolerance.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "precompute/job/cost/problem_size.hpp"
#include "precompute/run/run.hpp"
#include "precompute/run/stages.hpp"
#include "runtime/base/json.hpp"

namespace carillon::run {

/// A solved setting and its results.
struct Trial {
  Setting setting;
  std::int64_t nodes = 0;
  std::int64_t tets = 0;
  cost::ProblemSize size;
  double edge_m = 0.0;  // mean length of all element edges
  std::size_t modes = 0;
  double worst_cents = 0.0;                                  // largest error bar, algebraic plus discretisation
  double worst_hz = 0.0;                                     // its mode
  bank::Correction correction = bank::Correction::kOneMesh;  // of this mode
  double algebraic_cents = 0.0;                              // largest algebraic part
  double facet_cents = 0.0;                                  // largest addition by ambiguous facets; not part of a bar
  double cpu_seconds = 0.0;                                  // all ranks
  std::int64_t peak_bytes = 0;                               // all ranks, the process so far
  error_bars::Level level;                                   // its modes and error estimates
};

/// The next stricter setting and its predicted cost.
struct Forecast {
  Setting setting;
  bool needs_new_mesh = false;  // another mesh file with half the edge length: the run cannot refine this one further
  double nodes = 0.0;
  double worst_cents = 0.0;  // 0: unknown
  double cpu_seconds = 0.0;
  double bytes = 0.0;
};

struct AccuracyReport {
  double asked_cents = 0.0;
  std::vector<Trial> trials;  // the last one was chosen
  Forecast next;
};

/// Solves the job's body in the cheapest setting whose largest error bar is at most accuracy_cents. A coarse trial predicts the mesh size
/// for T4 and T10 from its error bars and their convergence rates; then that one is solved, then finer ones until the target is met. Bodies
/// are meshed as needed; a mesh file is used with either element and refined uniformly, which keeps its facets. The additional error of
/// ambiguous facets is recorded separately. Logs every trial and the cost of the next stricter setting. Collective. Throws on every rank
/// the errors of the solve, and SolveError if no setting meets the target, with the accuracy reached, the reason, and the cost of the next
/// stricter setting.
Solution solve_to_accuracy(Run& run, AccuracyReport& report);

/// First trial of solve_to_accuracy().
Setting find_first_setting(const Run& run);

/// make_body() for a trial. If the mesher cannot meet the node count (thin walls), uses the count that it suggests and stores it in
/// `setting`. Collective. Throws as make_body().
Body make_trial_body(Run& run, Setting& setting);

/// "T10, meshed with edges of 0.0021 m, tolerance 1e-07".
std::string describe(const Setting& setting);

base::Json describe_accuracy(const AccuracyReport& report);

}  // namespace carillon::run
