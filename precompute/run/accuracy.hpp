// Accuracy as an input: "accuracy_cents" in a job instead of element, mesh size and tolerance.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "precompute/run/solve_body.hpp"
#include "runtime/base/json.hpp"

namespace carillon::run {

/// One setting that was solved, and what came of it.
struct Trial {
  Setting setting;
  std::int64_t nodes = 0;
  std::int64_t tets = 0;
  cost::ProblemSize size;
  double edge_m = 0.0;  // mean length of the edges of all elements
  std::size_t modes = 0;
  double worst_cents = 0.0;      // largest error bar, algebraic and discretisation together
  double worst_hz = 0.0;         // of the mode that has it
  double algebraic_cents = 0.0;  // largest of that part
  double facet_cents = 0.0;      // largest addition by facets in doubt; not part of a bar
  double cpu_seconds = 0.0;      // all ranks
  std::int64_t peak_bytes = 0;   // all ranks, the process so far
  error_bars::Level level;       // its modes and what the estimate says of them
};

/// The next stricter setting and its predicted cost.
struct Forecast {
  Setting setting;
  bool needs_new_mesh = false;  // edges half as long, in another mesh file: the run cannot refine this one (further)
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

struct AccurateBody {
  Setting setting;
  Body body;
  SolvedBody solved;
  AccuracyReport report;
};

/// Solves the job's body in the cheapest setting whose largest error bar is no more than the job's accuracy_cents: a coarse one first,
/// whose error bars and their rates of convergence predict the mesh size, with tetrahedra of four and of ten nodes; then that
/// one; then finer ones while they do not meet it. Bodies are meshed as fine as is needed; a mesh file is taken with either element and
/// refined uniformly, which cannot correct the facets it was made with. The additional error by facets in doubt is recorded, not part of a
/// bar. Logs every trial, and at the end the cost of the next stricter setting. Collective. Throws on every rank the errors of the solve,
/// and SolveError if no setting within reach meets it, with the accuracy reached, the reason, and the cost of the next stricter setting.
AccurateBody solve_to_accuracy(Run& run);

/// What solve_to_accuracy() tries first.
Setting find_first_setting(const Run& run);

/// make_body() for a trial: where the mesher cannot meet the count of nodes, which thin walls do not let be small, with the count that it
/// names in its place; `setting` has that count then. Collective. Throws as make_body().
Body make_trial_body(Run& run, Setting& setting, Patience* patience = nullptr);

/// The setting in words: "T10, meshed with edges of 0.0021 m, tolerance 1e-07".
std::string describe(const Setting& setting);

base::Json describe_accuracy(const AccuracyReport& report);

}  // namespace carillon::run
